//! Serves a recording to a browser on this computer: the page, its updates, and a button that ends the recording.
//!
//! The address contains a secret, so neither another user of the computer nor a web page can watch or stop an
//! experiment. The page requests updates several times a second. A slow browser only slows down its own page: the
//! recorder adds a row to the [`Feed`] and continues.

use super::error::LiveError;
use super::feed::Feed;
use std::io::{self, Read};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};
use study::secret::secret;
use tiny_http::{Header, Method, Request, Response, Server};

/// A page counts as open if it has requested updates within this time. Pages do so four times a second. On a busy computer,
/// seconds may pass between two requests, and a user who stops the motors on a page must see that they are off.
const ASKS_WITHIN: Duration = Duration::from_secs(10);

/// The longest note that a page may send, bytes.
const LONGEST_NOTE: u64 = 1000;

/// The server of the page. Dropping it releases the port.
pub struct Browser {
    server: Arc<Server>,
    address: SocketAddr,
    door: Arc<Door>,
    thread: Option<JoinHandle<()>>,
}

/// State of the server's thread.
struct Door {
    host: String,
    secret: String,
    page: String,
    feed: Feed,
    stop: Arc<AtomicBool>,
    /// When a page last requested updates.
    asked: std::sync::Mutex<Option<Instant>>,
    /// Whether a page has received the last words.
    told: AtomicBool,
}

impl Browser {
    /// Serves `page` and `feed` on a free port. The page's button sets `stop`.
    ///
    /// # Errors
    /// [`LiveError::Address`].
    pub fn serve(page: String, feed: Feed, stop: Arc<AtomicBool>) -> Result<Self, LiveError> {
        let any = SocketAddr::from(([127, 0, 0, 1], 0));
        let failed = |reason: String| LiveError::Address { address: any, reason };
        let server = Arc::new(Server::http(any).map_err(|error| failed(error.to_string()))?);
        let address = server.server_addr().to_ip().ok_or_else(|| failed("no address".to_owned()))?;
        let door = Arc::new(Door {
            host: address.to_string(),
            secret: secret(),
            page,
            feed,
            stop,
            asked: Default::default(),
            told: AtomicBool::new(false),
        });
        let (serves, behind) = (Arc::clone(&server), Arc::clone(&door));
        let serve = move || {
            for request in serves.incoming_requests() {
                // A browser that has disconnected does not affect later ones.
                let _ = behind.answer(request);
            }
        };
        let thread = Builder::new().name("browser".into()).spawn(serve).map_err(|error| failed(error.to_string()))?;
        Ok(Self { server, address, door, thread: Some(thread) })
    }

    /// Returns the address of the page. Anyone who knows it can watch and stop the recording.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.door.secret)
    }

    /// Ends the recording for the page. An open page gets up to ten seconds to fetch the rest.
    pub fn end(&self, words: &str) {
        self.door.feed.end(words);
        let is_open = |asked: Option<Instant>| asked.is_some_and(|asked| asked.elapsed() < ASKS_WITHIN);
        while !self.door.told.load(Ordering::Relaxed) && is_open(*study::lock::lock(&self.door.asked)) {
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        self.server.unblock();
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl std::fmt::Debug for Browser {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Browser").field(&self.address).finish()
    }
}

impl Door {
    fn answer(&self, mut request: Request) -> io::Result<()> {
        let value = |name: &'static str| {
            let header = request.headers().iter().find(|header| header.field.equiv(name));
            header.map(|header| header.value.as_str().to_owned())
        };
        // A web page may point its own name at this computer, but the browser then sends that name.
        let is_ours = value("Host").is_some_and(|host| host == self.host)
            && value("Origin").is_none_or(|origin| origin == format!("http://{}", self.host));
        let (path, query) = request.url().split_once('?').unwrap_or((request.url(), ""));
        let Some(name) = path.strip_prefix('/').and_then(|path| path.strip_prefix(&self.secret)).filter(|_| is_ours)
        else {
            return request
                .respond(Response::from_string("this page may not watch the experiment\n").with_status_code(403));
        };
        match (request.method(), name) {
            (Method::Get, "/") => request.respond(kept_private(&self.page, "text/html; charset=utf-8")),
            (Method::Get, "/news") => {
                let number = |name: &str| {
                    let value = query.split('&').find_map(|pair| pair.strip_prefix(name)?.strip_prefix('='));
                    value.and_then(|value| value.parse().ok()).unwrap_or(0)
                };
                let news = self.feed.news(number("trial") as u32, number("have"));
                let is_last = !news["ended"].is_null();
                let answered = request.respond(kept_private(&news.to_string(), "application/json"));
                *study::lock::lock(&self.asked) = Some(Instant::now());
                self.told.fetch_or(is_last && answered.is_ok(), Ordering::Relaxed);
                answered
            }
            (Method::Post, "/note") => {
                let mut text = String::new();
                request.as_reader().take(LONGEST_NOTE).read_to_string(&mut text)?;
                study::lock::lock(&self.feed.notes).push(text);
                request.respond(kept_private("noted\n", "text/plain"))
            }
            (Method::Post, "/stop") => {
                self.stop.store(true, Ordering::Relaxed);
                request.respond(kept_private("stopping\n", "text/plain"))
            }
            _ => request.respond(Response::from_string("nothing is here\n").with_status_code(404)),
        }
    }
}

/// Returns an answer that no cache stores and no other page or link sees.
fn kept_private(body: &str, kind: &str) -> Response<io::Cursor<Vec<u8>>> {
    let headers = [
        ("Content-Type", kind),
        ("Cache-Control", "no-store"),
        ("Referrer-Policy", "no-referrer"),
        ("X-Content-Type-Options", "nosniff"),
        ("X-Frame-Options", "DENY"),
    ];
    let headers = headers.into_iter().filter_map(|(name, value)| Header::from_bytes(name, value).ok());
    headers.fold(Response::from_string(body), Response::with_header)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::TcpStream;

    /// Sends a request with these headers and returns the answer.
    fn ask(browser: &Browser, method: &str, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(browser.address).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\n{headers}Content-Length: 0\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn only_the_own_page_with_its_secret_watches_and_stops() {
        let (feed, stop) = (Feed::default(), Arc::new(AtomicBool::new(false)));
        let browser = Browser::serve("<p>the page</p>".into(), feed.clone(), stop.clone()).unwrap();
        let host = format!("Host: {}\r\n", browser.address);
        let secret = &browser.door.secret;
        let path = |name: &str| format!("/{secret}/{name}");
        assert!(browser.url().ends_with(&path("")));
        let refused = |answer: String| answer.starts_with("HTTP/1.1 403");
        assert!(refused(ask(&browser, "POST", "/stop", &host)));
        let other = if secret.ends_with('0') { '1' } else { '0' };
        assert!(refused(ask(&browser, "GET", &format!("/{}{other}/", &secret[..31]), &host)));
        assert!(refused(ask(&browser, "POST", &path("stop"), "Host: evil.example\r\n")));
        assert!(refused(ask(&browser, "POST", &path("stop"), &format!("{host}Origin: http://evil.example\r\n"))));
        assert!(ask(&browser, "GET", &path("other"), &host).starts_with("HTTP/1.1 404"));
        assert!(!stop.load(Ordering::Relaxed));

        let page = ask(&browser, "GET", &path(""), &host);
        assert!(
            page.starts_with("HTTP/1.1 200") && page.ends_with("<p>the page</p>") && page.contains("no-store"),
            "{page}"
        );
        feed.begin("first", 30.0);
        let news = ask(&browser, "GET", &path("news?trial=1&have=0"), &host);
        assert!(news.contains(r#""name":"first""#) && news.contains(r#""ended":null"#), "{news}");
        assert!(refused(ask(&browser, "POST", &path("note"), "Host: evil.example\r\n")));
        assert!(study::lock::lock(&feed.notes).is_empty());
        assert!(ask(&browser, "POST", &path("note"), &host).starts_with("HTTP/1.1 200"));
        assert_eq!(*study::lock::lock(&feed.notes), [""]);
        let own = format!("{host}Origin: http://{}\r\n", browser.address);
        assert!(ask(&browser, "POST", &path("stop"), &own).starts_with("HTTP/1.1 200"));
        assert!(stop.load(Ordering::Relaxed));
    }

    #[test]
    fn the_end_waits_for_an_open_page_only() {
        let browser = Browser::serve(String::new(), Feed::default(), Arc::default()).unwrap();
        let begun = Instant::now();
        browser.end("done");
        assert!(begun.elapsed() < Duration::from_secs(1), "no page is open");
        *study::lock::lock(&browser.door.asked) = Some(Instant::now());
        let path = format!("/{}/news", browser.door.secret);
        let host = format!("Host: {}\r\n", browser.address);
        std::thread::scope(|scope| {
            let ending = scope.spawn(|| browser.end("done"));
            assert!(ask(&browser, "GET", &path, &host).contains(r#""ended":"done""#));
            ending.join().unwrap();
        });
        assert!(browser.door.told.load(Ordering::Relaxed));
    }
}
