//! `panotune serve`

use super::Failure;
use super::args::Global;
use super::args_runs::ServeArgs;
use crate::serve::Server;

pub(super) fn serve(global: &Global, args: &ServeArgs) -> Result<(), Failure> {
    let server = Server::bind(args.bind, args.allow_remote)?;
    match global.json {
        true => println!("{}", serde_json::json!({ "event": "serving", "address": server.address().to_string() })),
        false => println!("http://{}/", server.address()),
    }
    server.run(&global.results)
}
