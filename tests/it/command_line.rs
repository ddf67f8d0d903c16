//! Snapshots of the command line; `TRYCMD=overwrite` writes them anew.

#[test]
fn commands_say_what_they_are_documented_to_say() {
    trycmd::TestCases::new().case("tests/cli/*.trycmd").case("tests/cli/*.toml").run();
}
