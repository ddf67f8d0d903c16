//! What is sent: a head with its headers, then bytes or a file.

use std::fs::File;

use crate::report;

/// The type of pages.
pub const PAGE_TYPE: &str = "text/html; charset=utf-8";

/// What browsers may do with files of a run: show them with the images beside them, run nothing, fetch nothing else.
const FILE_POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; font-src data:; sandbox allow-same-origin \
     allow-downloads";
/// The same for reports, without what their script may do.
const REPORT_POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src 'self' data:; base-uri 'none'; form-action 'none'";
/// The same for answers without a page.
const DATA_POLICY: &str = "default-src 'none'; sandbox";

/// A lens.
const ICON: &[u8] = br##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><circle cx="8" cy="8" r="7" fill="#0072b2"/><circle cx="8" cy="8" r="3" fill="#fff"/></svg>"##;

/// The first line of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    Ok,
    BadRequest,
    NotFound,
    MethodNotAllowed,
    Timeout,
    ContentTooLarge,
    Misdirected,
    HeadTooLarge,
    Failed,
    Busy,
}

impl Status {
    fn line(self) -> &'static str {
        match self {
            Status::Ok => "200 OK",
            Status::BadRequest => "400 Bad Request",
            Status::NotFound => "404 Not Found",
            Status::MethodNotAllowed => "405 Method Not Allowed",
            Status::Timeout => "408 Request Timeout",
            Status::ContentTooLarge => "413 Content Too Large",
            Status::Misdirected => "421 Misdirected Request",
            Status::HeadTooLarge => "431 Request Header Fields Too Large",
            Status::Failed => "500 Internal Server Error",
            Status::Busy => "503 Service Unavailable",
        }
    }
}

/// What follows the head.
#[derive(Debug)]
pub enum Body {
    /// These bytes.
    Bytes(Vec<u8>),
    /// So many bytes of a file.
    File(File, u64),
}

/// An answer.
#[derive(Debug)]
pub struct Response {
    /// Its kind.
    pub status: Status,
    content_type: &'static str,
    policy: String,
    /// What follows the head.
    pub body: Body,
    /// Whether the body is only spoken of.
    pub head_only: bool,
}

impl Response {
    fn new(status: Status, content_type: &'static str, policy: &str, body: Body) -> Self {
        Self { status, content_type, policy: policy.to_owned(), body, head_only: false }
    }

    /// One line of text.
    pub fn text(status: Status, text: &str) -> Self {
        Self::new(status, "text/plain; charset=utf-8", DATA_POLICY, Body::Bytes(format!("{text}\n").into_bytes()))
    }

    /// The sign that browsers show beside a page's name.
    pub fn icon() -> Self {
        Self::new(Status::Ok, "image/svg+xml", DATA_POLICY, Body::Bytes(ICON.to_vec()))
    }

    /// A JSON value.
    pub fn json(bytes: Vec<u8>) -> Self {
        Self::new(Status::Ok, "application/json", DATA_POLICY, Body::Bytes(bytes))
    }

    /// A page of our own, with the policy that allows its style and script.
    pub fn page(html: &str, policy: &str) -> Self {
        Self::new(Status::Ok, PAGE_TYPE, policy, Body::Bytes(html.as_bytes().to_vec()))
    }

    /// A file of a run.
    pub fn file(content_type: &'static str, file: File, bytes: u64) -> Self {
        Self::new(Status::Ok, content_type, FILE_POLICY, Body::File(file, bytes))
    }

    /// A page of a run: it may run the script that this program gives its reports, and no other.
    pub fn report(file: File, bytes: u64) -> Self {
        let policy = format!("{REPORT_POLICY}; script-src {}", report::script_source());
        Self::new(Status::Ok, PAGE_TYPE, &policy, Body::File(file, bytes))
    }

    /// The answer to a request for the head alone, if `head_only`.
    pub fn with_head_only(self, head_only: bool) -> Self {
        Self { head_only, ..self }
    }

    /// Bytes of the body.
    pub fn length(&self) -> u64 {
        match &self.body {
            Body::Bytes(bytes) => bytes.len() as u64,
            Body::File(_, length) => *length,
        }
    }

    /// The head, up to and with the empty line.
    pub fn head(&self) -> Vec<u8> {
        let mut head = format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nContent-Security-Policy: {}\r\n\
             X-Content-Type-Options: nosniff\r\nX-Frame-Options: DENY\r\nReferrer-Policy: no-referrer\r\n\
             Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\n\
             Cache-Control: no-store\r\nConnection: close\r\n",
            self.status.line(),
            self.content_type,
            self.length(),
            self.policy,
        );
        if self.status == Status::MethodNotAllowed {
            head.push_str("Allow: GET, HEAD\r\n");
        }
        head.push_str("\r\n");
        head.into_bytes()
    }
}
