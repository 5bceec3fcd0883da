//! A network that fails, between workers and their server, and keeps a journal of what it carried.
//!
//! It understands as much of HTTP/1.1 as both sides speak: heads, `content-length`, one request after the other. Requests are
//! dropped, delayed or carried twice, answers are lost. The journal says which attempts were given out and which results the
//! server said it recorded.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use serde_json::Value;

/// Something that passed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Passed {
    /// An attempt was given to a worker.
    Claimed { job: String, attempt: u64 },
    /// The server answered that it recorded this attempt's result, now.
    Recorded { job: String, attempt: u64 },
    /// The server refused a write as stale.
    Refused,
}

/// The way to a server. Ends with the test's process.
#[derive(Clone)]
pub(crate) struct Flaky {
    pub(crate) address: String,
    shared: Arc<Shared>,
}

struct Shared {
    server: String,
    calm: AtomicBool,
    seed: AtomicU64,
    journal: Mutex<Vec<Passed>>,
}

impl Flaky {
    pub(crate) fn to(server: &str, seed: u64) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let server = server.trim_start_matches("http://").to_owned();
        let journal = Mutex::default();
        let shared = Arc::new(Shared { server, calm: AtomicBool::new(false), seed: seed.into(), journal });
        let of_listener = shared.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let shared = of_listener.clone();
                // Errors are what this is for: the connection ends.
                std::thread::spawn(move || drop(shared.connect(client)));
            }
        });
        Self { address, shared }
    }

    /// From now on everything passes.
    pub(crate) fn calm(&self) {
        self.shared.calm.store(true, SeqCst);
    }

    pub(crate) fn journal(&self) -> MutexGuard<'_, Vec<Passed>> {
        self.shared.journal.lock().unwrap()
    }
}

impl Shared {
    fn connect(&self, mut client: TcpStream) -> io::Result<()> {
        let mut random = fastrand::Rng::with_seed(self.seed.fetch_add(1, SeqCst));
        let mut server = TcpStream::connect(&self.server)?;
        let mut early = Vec::new();
        loop {
            let request = message(&mut client, &mut early)?;
            let fate = if self.calm.load(SeqCst) { 100 } else { random.u32(0..100) };
            match fate {
                0..3 => return Ok(()),
                3..8 => {
                    let mut other = TcpStream::connect(&self.server)?;
                    self.exchange(&request, &mut other)?;
                }
                8..13 => std::thread::sleep(Duration::from_millis(random.u64(0..1500))),
                _ => {}
            }
            let answer = self.exchange(&request, &mut server)?;
            if matches!(fate, 13..16) {
                return Ok(());
            }
            client.write_all(&answer)?;
        }
    }

    /// One request and its answer.
    fn exchange(&self, request: &[u8], server: &mut TcpStream) -> io::Result<Vec<u8>> {
        server.write_all(request)?;
        let answer = message(server, &mut Vec::new())?;
        self.note(&String::from_utf8_lossy(request), &String::from_utf8_lossy(&answer));
        Ok(answer)
    }

    fn note(&self, request: &str, answer: &str) {
        let path = request.split(' ').nth(1).unwrap_or_default();
        let body: Value = answer
            .split_once("\r\n\r\n")
            .and_then(|(_, body)| serde_json::from_str(body).ok())
            .unwrap_or_default();
        let mut journal = self.journal.lock().unwrap();
        if path == "/v1/claims" {
            for row in body["attempts"].as_array().into_iter().flatten() {
                let (job, attempt) =
                    (row["job_id"].as_str().unwrap().to_owned(), row["attempt"].as_u64().unwrap());
                journal.push(Passed::Claimed { job, attempt });
            }
        }
        let Some(rest) = path.strip_prefix("/v1/jobs/") else { return };
        let mut parts = rest.split('/');
        let (Some(job), Some("attempts"), Some(attempt), Some(kind)) =
            (parts.next(), parts.next(), parts.next(), parts.next())
        else {
            return;
        };
        if answer.starts_with("HTTP/1.1 409") {
            journal.push(Passed::Refused);
        } else if kind == "result" && body["recorded"] == true {
            journal.push(Passed::Recorded { job: job.to_owned(), attempt: attempt.parse().unwrap() });
        }
    }
}

/// A head and its body; what came of the next one stays in `early`.
fn message(from: &mut TcpStream, early: &mut Vec<u8>) -> io::Result<Vec<u8>> {
    let mut bytes = std::mem::take(early);
    let mut buffer = [0; 16 * 1024];
    loop {
        if let Some(end) = bytes.windows(4).position(|four| four == b"\r\n\r\n") {
            let head = String::from_utf8_lossy(&bytes[..end]).to_ascii_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length:"));
            let length: usize = length.and_then(|text| text.trim().parse().ok()).unwrap_or(0);
            let total = end + 4 + length;
            if bytes.len() >= total {
                *early = bytes.split_off(total);
                return Ok(bytes);
            }
        }
        match from.read(&mut buffer)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            count => bytes.extend_from_slice(&buffer[..count]),
        }
    }
}
