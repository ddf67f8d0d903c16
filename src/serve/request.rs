//! What a client asks for. Pure: bytes in, a request or a refusal out.

use super::response::{Response, Status};

/// Largest head of a request, bytes; more is refused.
pub const HEAD_LIMIT: usize = 8 << 10;
/// Most header lines.
const HEADERS: usize = 64;

/// A request for something.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// Decoded path, from `/` on, without its query.
    pub path: String,
    /// Whether only the head of the answer is wanted.
    pub head_only: bool,
}

/// Why a request is not answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Refusal {
    status: Status,
    why: &'static str,
}

impl From<Refusal> for Response {
    fn from(refusal: Refusal) -> Self {
        Response::text(refusal.status, refusal.why)
    }
}

/// The values of `Host` that are answered to.
#[derive(Debug, Clone)]
pub struct Hosts(Vec<String>);

impl Hosts {
    /// Names of this machine for itself, with and without `port`.
    pub fn loopback(port: u16) -> Self {
        let names = ["localhost", "127.0.0.1", "[::1]"];
        Self(names.iter().flat_map(|name| [(*name).to_owned(), format!("{name}:{port}")]).collect())
    }

    fn allow(&self, host: &str) -> bool {
        self.0.iter().any(|known| known.eq_ignore_ascii_case(host))
    }
}

/// Whether the head of a request is complete: it ends with an empty line.
pub fn is_complete(bytes: &[u8]) -> bool {
    bytes.windows(4).any(|w| w == b"\r\n\r\n") || bytes.windows(2).any(|w| w == b"\n\n")
}

/// Reads the head of a request.
///
/// # Errors
/// It is malformed or too long, has a body, asks for more than reading, or is not meant for this server.
pub fn parse(head: &[u8], hosts: Option<&Hosts>) -> Result<Request, Refusal> {
    let refuse = |status, why| Err(Refusal { status, why });
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    match parsed.parse(head) {
        Ok(httparse::Status::Complete(_)) => {}
        Ok(httparse::Status::Partial) => return refuse(Status::BadRequest, "the request has no end"),
        Err(httparse::Error::TooManyHeaders) => return refuse(Status::HeadTooLarge, "too many header lines"),
        Err(_) => return refuse(Status::BadRequest, "this is no HTTP/1 request"),
    }
    let values = |name: &'static str| {
        let lines = parsed.headers.iter().filter(move |h| h.name.eq_ignore_ascii_case(name));
        lines.map(|h| std::str::from_utf8(h.value).unwrap_or("\0"))
    };
    match (values("host").collect::<Vec<_>>().as_slice(), hosts) {
        ([host], Some(hosts)) if !hosts.allow(host) => {
            return refuse(Status::Misdirected, "this server answers only to names of its own machine");
        }
        ([_], _) => {}
        _ => return refuse(Status::BadRequest, "a request has one Host header"),
    }
    let head_only = match parsed.method {
        Some("GET") => false,
        Some("HEAD") => true,
        _ => return refuse(Status::MethodNotAllowed, "only GET and HEAD are answered"),
    };
    let has_body = values("content-length").any(|v| v.trim() != "0") || values("transfer-encoding").next().is_some();
    if has_body {
        return refuse(Status::ContentTooLarge, "requests have no body");
    }
    let target = parsed.path.unwrap_or_default();
    let path = target.split(['?', '#']).next().unwrap_or_default();
    match decode(path).filter(|path| path.starts_with('/')) {
        Some(path) => Ok(Request { path, head_only }),
        None => refuse(Status::BadRequest, "this is no path"),
    }
}

/// Undoes percent-encoding; `None` for what is no text then.
fn decode(path: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(path.len());
    let mut rest = path.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        if *first != b'%' {
            bytes.push(*first);
            rest = after;
            continue;
        }
        let digit = |place: usize| after.get(place).and_then(|b| (*b as char).to_digit(16));
        bytes.push((digit(0)? * 16 + digit(1)?) as u8);
        rest = &after[2..];
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn read(text: &str) -> Result<Request, Status> {
        parse(text.as_bytes(), Some(&Hosts::loopback(80))).map_err(|refusal| refusal.status)
    }

    fn path(target: &str) -> Result<String, Status> {
        read(&format!("GET {target} HTTP/1.1\r\nHost: localhost\r\n\r\n")).map(|request| request.path)
    }

    #[test]
    fn paths_are_decoded_once() {
        assert_eq!(path("/a%20b?x=%2F"), Ok("/a b".to_owned()));
        assert_eq!(path("/%252e%252e/x"), Ok("/%2e%2e/x".to_owned()));
        assert_eq!(path("/%C3%BC"), Ok("/ü".to_owned()));
        for target in ["/%", "/%2", "/%zz", "/%ff", "a", "*", "http://localhost/", "/%+1"] {
            assert_eq!(path(target), Err(Status::BadRequest), "{target}");
        }
    }

    #[test]
    fn only_reading_from_this_machine_is_allowed() {
        let with = |method: &str, header: &str| read(&format!("{method} / HTTP/1.1\r\n{header}\r\n\r\n"));
        for host in ["localhost", "LOCALHOST:80", "127.0.0.1:80", "[::1]"] {
            assert!(with("GET", &format!("Host: {host}")).is_ok(), "{host}");
        }
        for host in ["evil.example", "localhost:81", "localhost.evil.example", "127.0.0.1.evil.example", ""] {
            assert_eq!(with("GET", &format!("Host: {host}")), Err(Status::Misdirected), "{host}");
        }
        assert_eq!(with("GET", "Accept: */*"), Err(Status::BadRequest));
        assert_eq!(with("GET", "Host: localhost\r\nHost: localhost"), Err(Status::BadRequest));
        for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "get"] {
            assert_eq!(with(method, "Host: localhost"), Err(Status::MethodNotAllowed), "{method}");
        }
        assert!(with("HEAD", "Host: localhost").unwrap().head_only);
        assert_eq!(with("GET", "Host: localhost\r\nContent-Length: 5"), Err(Status::ContentTooLarge));
        assert_eq!(with("GET", "Host: localhost\r\nTransfer-Encoding: chunked"), Err(Status::ContentTooLarge));
        let many = vec!["X: y"; 100].join("\r\n");
        assert_eq!(with("GET", &format!("Host: localhost\r\n{many}")), Err(Status::HeadTooLarge));
    }

    proptest! {
        #[test]
        fn no_bytes_break_the_parser(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = parse(&bytes, None);
            let mut request = b"GET /".to_vec();
            request.extend(bytes);
            request.extend(b" HTTP/1.1\r\nHost: localhost\r\n\r\n");
            if let Ok(request) = parse(&request, Some(&Hosts::loopback(80))) {
                prop_assert!(request.path.starts_with('/'));
            }
        }
    }
}
