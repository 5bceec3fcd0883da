//! A faulty network between workers and their server, with a journal of its messages.
//!
//! It understands the part of HTTP/1.1 that both sides use: headers, `content-length`, one request after the other. It drops,
//! delays and repeats requests, and drops responses. The journal has the claimed attempts and the results that the server has
//! recorded.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use serde_json::Value;

/// An entry of the journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Passed {
    /// A worker has claimed an attempt.
    Claimed { job: String, attempt: u64 },
    /// The server has recorded the result of this attempt.
    Recorded { job: String, attempt: u64 },
    /// The server has refused a stale write.
    Refused,
    /// The server has answered a request with several results.
    Together,
}

/// A faulty proxy in front of a server or several, which ends with the process of the test.
#[derive(Clone)]
pub(crate) struct Flaky {
    pub(crate) address: String,
    shared: Arc<Shared>,
}

struct Shared {
    servers: Vec<String>,
    calm: AtomicBool,
    seed: AtomicU64,
    journal: Mutex<Vec<Passed>>,
}

impl Flaky {
    pub(crate) fn to(servers: &[&str], seed: u64) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let servers = servers.iter().map(|server| server.trim_start_matches("http://").to_owned()).collect();
        let journal = Mutex::default();
        let shared = Arc::new(Shared { servers, calm: AtomicBool::new(false), seed: seed.into(), journal });
        let of_listener = shared.clone();
        std::thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let shared = of_listener.clone();
                // Errors are intended: the connection ends.
                std::thread::spawn(move || drop(shared.connect(client)));
            }
        });
        Self { address, shared }
    }

    /// Forwards everything unchanged from now on.
    pub(crate) fn stop_faults(&self) {
        self.shared.calm.store(true, SeqCst);
    }

    pub(crate) fn journal(&self) -> MutexGuard<'_, Vec<Passed>> {
        self.shared.journal.lock().unwrap()
    }
}

impl Shared {
    fn connect(&self, mut client: TcpStream) -> io::Result<()> {
        let mut random = fastrand::Rng::with_seed(self.seed.fetch_add(1, SeqCst));
        let mut server = self.reach(&mut random)?;
        let mut early = Vec::new();
        loop {
            let request = message(&mut client, &mut early)?;
            let fate = if self.calm.load(SeqCst) { 100 } else { random.u32(0..100) };
            match fate {
                0..3 => return Ok(()),
                3..8 => {
                    let mut other = self.reach(&mut random)?;
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

    /// A connection to one of the servers that run.
    fn reach(&self, random: &mut fastrand::Rng) -> io::Result<TcpStream> {
        let first = random.usize(0..self.servers.len());
        let mut order = self.servers[first..].iter().chain(&self.servers[..first]);
        order
            .find_map(|server| TcpStream::connect(server).ok())
            .ok_or(io::ErrorKind::ConnectionRefused.into())
    }

    /// Forwards one request and its response.
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
        let attempt_of =
            |row: &Value| (row["job_id"].as_str().unwrap().to_owned(), row["attempt"].as_u64().unwrap());
        if path == "/v1/claims" {
            for row in body["attempts"].as_array().into_iter().flatten() {
                let (job, attempt) = attempt_of(row);
                journal.push(Passed::Claimed { job, attempt });
            }
        }
        if path == "/v1/results" {
            for row in body["answers"].as_array().into_iter().flatten() {
                let (job, attempt) = attempt_of(row);
                match row["problem"]["status"].as_u64() {
                    Some(409) => journal.push(Passed::Refused),
                    _ if row["recorded"] == true => journal.push(Passed::Recorded { job, attempt }),
                    _ => {}
                }
            }
            journal.push(Passed::Together);
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

/// Reads header and body of a message; bytes of the next message stay in `early`.
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
