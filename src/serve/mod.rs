//! Runs in a browser: a list, each one's state while it runs, and the files of finished ones.
//!
//! Data flows one way: [`network`] moves bytes for all connections and never waits for any of them; a few workers turn
//! a [`request::Request`] into a [`response::Response`] by [`pages`]. Nothing can be written, and nothing outside the
//! results folder can be read.

mod files;
mod network;
mod pages;
mod request;
mod response;

use std::net::{SocketAddr, TcpListener};
use std::path::Path;

use crate::error::{Class, Classify};

/// Why nothing is served.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The address is not this machine's own.
    #[error(
        "{address} can be reached from other machines\nhint: bind to 127.0.0.1, or say `--allow-remote`; everybody who reaches it may read all runs"
    )]
    Remote {
        /// The address.
        address: SocketAddr,
    },
    /// The address cannot be had.
    #[error(
        "cannot listen at {address}: {source}\nhint: name another port with `--bind 127.0.0.1:PORT`; port 0 takes a free one"
    )]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the operating system said.
        source: std::io::Error,
    },
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Input
    }
}

/// A listener at an address.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    address: SocketAddr,
}

impl Server {
    /// Listens at `address`, which must be a loopback address unless `allow_remote` is set.
    ///
    /// # Errors
    /// Another address, or one that cannot be had.
    pub fn bind(address: SocketAddr, allow_remote: bool) -> Result<Self, Error> {
        if !address.ip().is_loopback() && !allow_remote {
            return Err(Error::Remote { address });
        }
        let failed = |source| Error::Bind { address, source };
        let listener = TcpListener::bind(address).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        Ok(Self { listener, address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves the runs below `results` until the process ends.
    pub fn run(self, results: &Path) -> ! {
        // On a loopback address only names of this machine are answered to, so that no page of another site that has
        // its name point here can read anything.
        let hosts = self.address.ip().is_loopback().then(|| request::Hosts::loopback(self.address.port()));
        let site = pages::Site::new(results);
        network::serve(&self.listener, &|head| match request::parse(head, hosts.as_ref()) {
            Ok(request) => site.answer(&request.path).with_head_only(request.head_only),
            Err(refusal) => refusal.into(),
        })
    }
}
