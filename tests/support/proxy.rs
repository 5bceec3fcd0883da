//! A proxy between worker and server that counts requests for mesh files, and can stall or break them.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering::SeqCst};
use std::time::Duration;

/// Treatment of mesh files; all other requests are forwarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Files {
    Pass,
    /// Forwards only their first bytes.
    Stall,
    /// Responds like a server without these files.
    Deny,
}

/// A proxy in front of a server, which ends with the process of the test.
#[derive(Clone)]
pub(crate) struct Proxy {
    pub(crate) address: String,
    shared: Arc<Shared>,
}

struct Shared {
    server: String,
    files: AtomicU8,
    asked: AtomicUsize,
    stalled: AtomicUsize,
}

impl Proxy {
    pub(crate) fn to(server: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let server = server.trim_start_matches("http://").to_owned();
        let shared = Shared { server, files: AtomicU8::new(0), asked: 0.into(), stalled: 0.into() };
        let proxy = Self { address, shared: Arc::new(shared) };
        let shared = proxy.shared.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let shared = shared.clone();
                std::thread::spawn(move || shared.connect(client));
            }
        });
        proxy
    }

    pub(crate) fn set(&self, files: Files) {
        self.shared.files.store(files as u8, SeqCst);
    }

    /// Number of requested files.
    pub(crate) fn requested(&self) -> usize {
        self.shared.asked.load(SeqCst)
    }

    /// Number of stalled files.
    pub(crate) fn stalled(&self) -> usize {
        self.shared.stalled.load(SeqCst)
    }
}

impl Shared {
    fn is(&self, files: Files) -> bool {
        self.files.load(SeqCst) == files as u8
    }

    /// Serves one connection with consecutive requests.
    fn connect(self: Arc<Self>, mut client: TcpStream) {
        let Ok(mut server) = TcpStream::connect(&self.server) else { return };
        let asked_here = Arc::new(AtomicUsize::new(0));
        let (back, mut from, mut to) =
            (self.clone(), server.try_clone().unwrap(), client.try_clone().unwrap());
        let asked_before = asked_here.clone();
        std::thread::spawn(move || back.answers(&mut from, &mut to, &asked_before));
        let mut buffer = [0; 16 * 1024];
        while let Ok(count @ 1..) = client.read(&mut buffer) {
            // A header of this size arrives in one piece.
            let text = String::from_utf8_lossy(&buffer[..count]);
            if text.starts_with("GET /v1/meshes/") && text.contains("/file HTTP/1.1") {
                self.asked.fetch_add(1, SeqCst);
                asked_here.fetch_add(1, SeqCst);
                if self.is(Files::Deny) {
                    let problem = r#"{"type": "/problems/not-found", "title": "none", "status": 404, "detail": "no such mesh"}"#;
                    let length = problem.len();
                    let answer =
                        format!("HTTP/1.1 404 Not Found\r\ncontent-length: {length}\r\n\r\n{problem}");
                    let _ = client.write_all(answer.as_bytes());
                    continue;
                }
            }
            if server.write_all(&buffer[..count]).is_err() {
                break;
            }
        }
        let _ = server.shutdown(Shutdown::Both);
    }

    fn answers(&self, server: &mut TcpStream, client: &mut TcpStream, asked: &AtomicUsize) {
        let mut answered = 0;
        let mut buffer = [0; 1024];
        while let Ok(count @ 1..) = server.read(&mut buffer) {
            if client.write_all(&buffer[..count]).is_err() {
                break;
            }
            if asked.load(SeqCst) > answered && self.is(Files::Stall) {
                answered = asked.load(SeqCst);
                self.stalled.fetch_add(1, SeqCst);
                while self.is(Files::Stall) {
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
        }
        let _ = client.shutdown(Shutdown::Both);
    }
}
