//! What `panotune serve` gives, and what it refuses.

use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use crate::http::{Served, json, parts, status};
use crate::support::{fail_with, panotune};

const RUN: &str = "study/s1-0123abcd-1";

/// Results with a finished and an unfinished run, and things that must not be read.
fn results(folder: &Path) -> std::path::PathBuf {
    let results = folder.join("results");
    let run = results.join(RUN);
    let write = |path: &Path, text: &str| {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write(&run.join("report.html"), "<h1>report</h1>");
    write(&run.join("tables/table_1.md"), "| a |");
    write(&run.join("figures/figure_3.svg"), "<svg/>");
    write(&run.join("SHA256SUMS"), "");
    write(&run.join(".lock"), "secret");
    write(&run.join("large.bin"), &"x".repeat(8 << 20));
    write(&results.join("study/s2-0123abcd-1/report.html"), "unfinished secret");
    write(&results.join(".cache/secret.txt"), "secret");
    write(&results.join("secret.txt"), "secret");
    write(&folder.join("secret.txt"), "secret");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder, run.join("out")).unwrap();
        std::os::unix::fs::symlink(folder.join("secret.txt"), run.join("tables/link.md")).unwrap();
        std::os::unix::fs::symlink(&run, results.join("study/s3-0123abcd-1")).unwrap();
        std::os::unix::fs::symlink(folder.join("results/study"), results.join("linked")).unwrap();
    }
    results
}

#[test]
fn pages_and_files_have_their_types_and_headers() {
    let folder = tempfile::tempdir().unwrap();
    let server = Served::start(&results(folder.path()));
    for (target, kind, body) in [
        ("/", "text/html; charset=utf-8", "<h1>"),
        (&format!("/runs/{RUN}/"), "text/html; charset=utf-8", "follow("),
        (&format!("/files/{RUN}/report.html"), "text/html; charset=utf-8", "<h1>report</h1>"),
        (&format!("/files/{RUN}/figures/figure_3.svg"), "image/svg+xml", "<svg/>"),
        (&format!("/files/{RUN}/tables/table%5F1.md?x=1"), "text/plain; charset=utf-8", "| a |"),
        ("/favicon.ico", "image/svg+xml", "<svg"),
        ("/api/runs", "application/json", RUN),
    ] {
        let answer = server.get(target);
        assert_eq!(status(&answer), 200, "{target}");
        let (head, text) = parts(&answer);
        assert!(head.contains(&format!("Content-Type: {kind}\r\n")), "{target}: {head}");
        assert!(
            head.contains("X-Content-Type-Options: nosniff\r\n")
                && head.contains("Content-Security-Policy: default-src 'none'")
        );
        if body != "<h1>" {
            assert!(String::from_utf8_lossy(&text).contains(body), "{target}");
        }
        assert!(head.contains(&format!("Content-Length: {}\r\n", text.len())), "{target}");
    }
    let head = server.raw(format!("HEAD /files/{RUN}/report.html HTTP/1.1\r\nHost: localhost\r\n\r\n").as_bytes());
    let (head, body) = parts(&head);
    assert!(head.contains("Content-Length: 15\r\n") && body.is_empty(), "{head}");
    let (_, large) = parts(&server.get(&format!("/files/{RUN}/large.bin")));
    assert_eq!(large.len(), 8 << 20);
    let files = json(&server.get(&format!("/api/runs/{RUN}")))["files"].clone();
    assert_eq!(files, serde_json::json!(["figures/figure_3.svg", "report.html", "tables/table_1.md"]));
}

#[test]
fn nothing_outside_a_finished_run_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let server = Served::start(&results(folder.path()));
    for target in [
        "/files/study/s1-0123abcd-1/../../secret.txt",
        "/files/study/s1-0123abcd-1/..%2f..%2fsecret.txt",
        "/files/study/s1-0123abcd-1/%2e%2e/%2e%2e/secret.txt",
        "/files/study/s1-0123abcd-1/%2e%2e%2f%2e%2e%2fsecret.txt",
        "/files/study/s1-0123abcd-1/..%5c..%5csecret.txt",
        "/files/study/s1-0123abcd-1/tables/..%2f..%2f..%2f..%2fsecret.txt",
        "/files/study/s1-0123abcd-1/%252e%252e/%252e%252e/secret.txt",
        "/files/study/s1-0123abcd-1//secret.txt",
        "/files/study/s1-0123abcd-1/%00",
        "/files/study/s1-0123abcd-1/report.html%00.png",
        "/files/study/s1-0123abcd-1/.lock",
        "/files/study/s1-0123abcd-1/%2elock",
        "/files/study/s1-0123abcd-1/out/secret.txt",
        "/files/study/s1-0123abcd-1/tables/link.md",
        "/files/study/s1-0123abcd-1/tables",
        "/files/study/s1-0123abcd-1/",
        "/files/study/s1-0123abcd-1",
        "/files/study/s1-0123abcd-1/C:%5csecret.txt",
        "/files/study/s1-0123abcd-1/%c0%ae%c0%ae/secret.txt",
        "/files/study/s2-0123abcd-1/report.html",
        "/files/study/s3-0123abcd-1/report.html",
        "/files/linked/s1-0123abcd-1/report.html",
        "/files/.cache/s1-0123abcd-1/secret.txt",
        "/files/../results/study/s1-0123abcd-1/report.html",
        "/files//etc/passwd",
        "/secret.txt",
        "/.cache/secret.txt",
        "/..%2fsecret.txt",
        "//etc/passwd",
        "/api/runs/..%2f..",
        "/api/runs/study/s9-0123abcd-1",
        "/runs/reference/s1-0123abcd-1/",
    ] {
        let answer = server.get(target);
        let text = String::from_utf8_lossy(&answer).into_owned();
        assert!(matches!(status(&answer), 400 | 404), "{target}: {text}");
        assert!(
            !text.contains("secret") && !text.contains("root:") && !text.contains("<h1>report"),
            "{target}: {text}"
        );
    }
}

#[test]
fn only_reading_by_this_machines_own_names_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let server = Served::start(&results(folder.path()));
    let ask = |request: &str| status(&server.raw(request.as_bytes()));
    assert_eq!(ask("GET / HTTP/1.1\r\nHost: attacker.example\r\n\r\n"), 421);
    assert_eq!(ask("GET / HTTP/1.1\r\n\r\n"), 400);
    assert_eq!(ask("POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n"), 405);
    assert_eq!(ask("DELETE /files/study/s1-0123abcd-1/report.html HTTP/1.1\r\nHost: localhost\r\n\r\n"), 405);
    assert_eq!(ask("GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n"), 413);
    let said = fail_with(2, panotune(folder.path()).args(["serve", "--bind", "0.0.0.0:0"]));
    assert!(said.contains("--allow-remote"), "{said}");
    let said = fail_with(2, panotune(folder.path()).args(["serve", "--bind", &server.address]));
    assert!(said.contains("cannot listen at"), "{said}");
}

#[test]
fn malformed_requests_and_slow_clients_stop_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = Served::start(&results(folder.path()));
    assert_eq!(status(&server.raw(b"\x00\xff\xfe garbage\r\n\r\n")), 400);
    assert_eq!(status(&server.raw(b"\r\n\r\n\r\n\r\n")), 400);
    assert_eq!(status(&server.raw(b"GET /\r\n\r\n")), 400);
    assert_eq!(status(&server.raw(b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n")), 400);
    let huge = format!("GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n", "y".repeat(1 << 20));
    assert!(matches!(status(&server.raw(huge.as_bytes())), 431 | 0));
    let many = format!("GET / HTTP/1.1\r\nHost: localhost\r\n{}\r\n", "A: b\r\n".repeat(200));
    assert_eq!(status(&server.raw(many.as_bytes())), 431);
    let long = format!("GET /{} HTTP/1.1\r\nHost: localhost\r\n\r\n", "a".repeat(7000));
    assert_eq!(status(&server.raw(long.as_bytes())), 404);

    // half requests, silent clients, and clients that do not take what they asked for
    let mut slow: Vec<_> = (0..150).map(|_| server.connect()).collect();
    for (n, stream) in slow.iter_mut().enumerate() {
        match n % 3 {
            0 => drop(stream.write_all(b"GET / HTTP/1.1\r\nHost: loc")),
            1 => {}
            _ => {
                let request = format!("GET /files/{RUN}/large.bin HTTP/1.1\r\nHost: localhost\r\n\r\n");
                drop(stream.write_all(request.as_bytes()));
            }
        }
    }
    let begun = Instant::now();
    for _ in 0..20 {
        assert_eq!(status(&server.get("/api/runs")), 200);
    }
    // those who do not take their answers keep their connections for two minutes
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
    // a half request is told that it took too long, a silent client is left
    let mut answer = Vec::new();
    slow[0].read_to_end(&mut answer).unwrap();
    assert_eq!(status(&answer), 408);
    answer.clear();
    let _ = slow[1].read_to_end(&mut answer);
    assert!(answer.is_empty());

    // more than are taken at once
    let crowd: Vec<_> = (0..700).map(|_| std::net::TcpStream::connect(&server.address)).collect();
    drop(crowd);
    drop(slow);
    let begun = Instant::now();
    while status(&server.get("/api/runs")) != 200 {
        assert!(begun.elapsed() < Duration::from_secs(20), "the server does not recover");
    }
    assert!(server.is_alive());
}
