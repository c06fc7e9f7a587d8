//! A server for one page on this machine: GET only, three fixed names, nothing from the request but its first line and
//! `Host`.
//!
//! It listens on 127.0.0.1. A page of another site could still reach it through a name that it lets point here (DNS
//! rebinding), so a `Host` that is not this address is refused. There is no CORS header, so that no other page may read
//! an answer.

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

/// The name of the run's state, and of the scene that is served.
pub const STATE: &str = "/state.json";
pub const SCENE: &str = "/scene.json";

/// The port that a browser means where an address names none.
const HTTP: u16 = 80;

/// A request that is longer is refused, bytes: a browser's has some 700.
const REQUEST_MAX: usize = 8192;

/// A request that takes longer to arrive is given up.
const REQUEST_TIME: Duration = Duration::from_secs(5);

/// An answer that is not taken for so long is given up.
const ANSWER_TIME: Duration = Duration::from_secs(20);

/// Most connections at once; a browser opens six.
const CONNECTIONS_MAX: usize = 32;

/// The answers of the server: type and text by name. State and scene change while it runs.
#[derive(Debug)]
pub struct Answers(RwLock<BTreeMap<&'static str, (&'static str, Arc<String>)>>);

impl Answers {
    /// The page, with neither state nor scene yet.
    pub fn new(page: String) -> Self {
        let answers = Self(RwLock::new(BTreeMap::from([("/", ("text/html; charset=utf-8", Arc::new(page)))])));
        [STATE, SCENE].into_iter().for_each(|name| answers.set(name, "{}".into()));
        answers
    }

    /// Replaces [`STATE`] or [`SCENE`].
    pub fn set(&self, name: &'static str, json: String) {
        let mut answers = self.0.write().unwrap_or_else(PoisonError::into_inner);
        answers.insert(name, ("application/json", Arc::new(json)));
    }

    fn get(&self, name: &str) -> Option<(&'static str, Arc<String>)> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).get(name).cloned()
    }
}

/// Listens on 127.0.0.1; `port` 0: on any free port. Returns the port.
///
/// # Errors
/// A sentence when the port is taken.
pub fn start(port: u16, answers: Arc<Answers>) -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
        .with_context(|| format!("127.0.0.1:{port}: cannot listen; --port 0 takes a free one"))?;
    let port = listener.local_addr().context("127.0.0.1: cannot listen")?.port();
    let open = Arc::new(AtomicUsize::new(0));
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            // A connection that failed, and one too many, is closed.
            let Ok(stream) = stream else { continue };
            let place = Place::take(&open);
            let answers = answers.clone();
            if let Some(place) = place {
                // Without a thread for it the connection is closed as well.
                let _ = std::thread::Builder::new().spawn(move || {
                    let _place = place;
                    converse(stream, port, &answers);
                });
            }
        }
    });
    Ok(port)
}

/// One of the connections that may be open; given back when dropped.
struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(open: &Arc<AtomicUsize>) -> Option<Self> {
        let place = Self(open.clone());
        (open.fetch_add(1, Ordering::SeqCst) < CONNECTIONS_MAX).then_some(place)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

fn converse(mut stream: TcpStream, port: u16, answers: &Answers) {
    let Some(request) = read(&mut stream) else { return };
    let (status, kind, text) = match respond(&request, port) {
        Ok(name) => match answers.get(name) {
            Some((kind, text)) => ("200 OK", kind, text),
            None => ("404 Not Found", "text/plain", Arc::new("not here\n".into())),
        },
        Err(status) => (status, "text/plain", Arc::new("refused\n".into())),
    };
    let header = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\nCache-Control: no-store\r\n\
         X-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n",
        text.len()
    );
    // A reader that left needs no answer.
    let _ = stream.set_write_timeout(Some(ANSWER_TIME));
    let _ = stream.write_all(header.as_bytes()).and_then(|()| stream.write_all(text.as_bytes()));
}

/// The head of a request; `None` where none arrives in time.
fn read(stream: &mut TcpStream) -> Option<String> {
    let begun = Instant::now();
    let mut bytes = Vec::new();
    let mut part = [0; 1024];
    while !bytes.windows(4).any(|end| end == b"\r\n\r\n") && bytes.len() <= REQUEST_MAX {
        let left = REQUEST_TIME.checked_sub(begun.elapsed()).filter(|left| !left.is_zero())?;
        stream.set_read_timeout(Some(left)).ok()?;
        match stream.read(&mut part).ok()? {
            0 => return None,
            count => bytes.extend(&part[..count]),
        }
    }
    Some(String::from_utf8_lossy(&bytes).into_owned())
}

/// The name that a request asks for.
///
/// # Errors
/// The status of a request that is refused.
fn respond(request: &str, port: u16) -> Result<&str, &'static str> {
    let Some((head, _)) = request.split_once("\r\n\r\n") else { return Err("431 Request Header Fields Too Large") };
    let mut lines = head.split("\r\n");
    let words: Vec<&str> = lines.next().unwrap_or_default().split(' ').collect();
    let [method, name, version] = words[..] else { return Err("400 Bad Request") };
    if !version.starts_with("HTTP/1.") {
        return Err("400 Bad Request");
    }
    let mut hosts = lines.filter_map(|line| line.split_once(':')).filter(|(key, _)| key.eq_ignore_ascii_case("host"));
    match (hosts.next(), hosts.next()) {
        (Some((_, host)), None) if is_own(host.trim(), port) => {}
        _ => return Err("403 Forbidden"),
    }
    if method != "GET" {
        return Err("405 Method Not Allowed");
    }
    Ok(name)
}

/// Whether a `Host` is this server. Browsers leave out the port of HTTP.
fn is_own(host: &str, port: u16) -> bool {
    ["127.0.0.1", "localhost"].iter().any(|own| match host.strip_prefix(own) {
        Some("") => port == HTTP,
        Some(rest) => rest == format!(":{port}"),
        None => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_this_machine_and_get() {
        let ask_at = |port: u16, first: &str, host: &str| {
            let request = format!("{first}\r\nHost: {host}\r\n\r\n");
            respond(&request, port).map(str::to_string)
        };
        let ask = |first: &str, host: &str| ask_at(80, first, host);
        assert_eq!(ask("GET / HTTP/1.1", "127.0.0.1:80"), Ok("/".into()));
        assert_eq!(ask("GET /state.json HTTP/1.1", " localhost:80 "), Ok("/state.json".into()));
        assert_eq!(ask("GET / HTTP/1.1", "evil.example:80"), Err("403 Forbidden"));
        // Browsers leave out the port where it is that of HTTP, and only there.
        for host in ["127.0.0.1", "localhost"] {
            assert_eq!(ask("GET / HTTP/1.1", host), Ok("/".into()));
            assert_eq!(ask_at(8080, "GET / HTTP/1.1", host), Err("403 Forbidden"));
            assert_eq!(ask_at(8080, "GET / HTTP/1.1", &format!("{host}:8080")), Ok("/".into()));
        }
        for host in ["evil.example", "127.0.0.1.evil.example", "localhost:8080", "127.0.0.1:", ""] {
            assert_eq!(ask("GET / HTTP/1.1", host), Err("403 Forbidden"), "{host}");
        }
        assert_eq!(ask("GET / HTTP/1.1", "127.0.0.1:80\r\nHost: evil.example"), Err("403 Forbidden"));
        assert_eq!(ask("POST / HTTP/1.1", "127.0.0.1:80"), Err("405 Method Not Allowed"));
        assert_eq!(respond("GET / HTTP/1.1\r\n\r\n", 80), Err("403 Forbidden"));
        assert_eq!(respond("nonsense\r\n\r\n", 80), Err("400 Bad Request"));
        assert_eq!(respond("GET / HTTP/1.1\r\nHost: 127.0.0.1:80", 80), Err("431 Request Header Fields Too Large"));
    }

    #[test]
    fn names_are_fixed() {
        let answers = Answers::new("page".into());
        answers.set(STATE, "{\"a\":1}".into());
        assert_eq!(answers.get("/state.json").expect("a state").1.as_str(), "{\"a\":1}");
        for name in ["/../../etc/passwd", "//", "/scene.json?x", "/report.html", ""] {
            assert!(answers.get(name).is_none(), "{name}");
        }
    }

    /// Requests that are odd, and connections that say nothing, leave the server as it was.
    #[test]
    fn odd_requests_do_no_harm() {
        let port = start(0, Arc::new(Answers::new("the page".into()))).expect("a port");
        let connect = || TcpStream::connect((Ipv4Addr::LOCALHOST, port)).expect("connected");
        let ask = |bytes: &[u8]| {
            let mut stream = connect();
            // The server may close before everything is sent.
            let _ = stream.write_all(bytes);
            let mut answer = Vec::new();
            let _ = stream.read_to_end(&mut answer);
            String::from_utf8_lossy(&answer).into_owned()
        };
        let silent: Vec<TcpStream> = (0..5).map(|_| connect()).collect();
        assert!(ask(b"\x00\xff\r\n\r\n").starts_with("HTTP/1.1 400"));
        assert!(ask(&[b'a'; REQUEST_MAX + 2000]).len() < 400);
        let fine = ask(format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n").as_bytes());
        assert!(fine.starts_with("HTTP/1.1 200") && fine.ends_with("the page"));
        assert!(!fine.to_lowercase().contains("access-control"));
        let elsewhere = ask(b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n");
        assert!(elsewhere.starts_with("HTTP/1.1 403") && !elsewhere.contains("the page"));
        drop(silent);
    }
}
