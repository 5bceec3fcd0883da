//! Hostile clients: floods of incomplete requests, unknown methods, and exhausted file descriptors.
//!
//! With `ROOST_FULL=1` these are the proofs of `docs/proofs.md`; without it the slow test is smaller.

#[path = "../support/mod.rs"]
mod support;

mod descriptors;

use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::lease::HeartbeatRequest;
use roost_api::worker::WorkerRegistration;
use roost_server::ServerConfig;
use roost_solver::SOLVER_REVISION;
use roost_worker::client::{Client, MAX_IDLE};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use support::{Process, Sandbox, turn, wait_until};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpSocket;

const MIB: u64 = 1024 * 1024;

/// The head of a request that never ends.
const HALF: &[u8] = b"GET /v1/jobs HTTP/1.1\r\nhost: localhost\r\nx-more: ";

fn address(sandbox: &Sandbox) -> SocketAddr {
    sandbox.address.trim_start_matches("http://").parse().unwrap()
}

/// Sends a request on a new connection. Returns the response and the time.
fn ask(address: SocketAddr, path: &str) -> (String, Duration) {
    let started = Instant::now();
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    (answer, started.elapsed())
}

/// Maximum time of an answer during a flood; without `ROOST_FULL` with room for a busy machine. A blocked server takes ten seconds.
fn longest_answer() -> Duration {
    Duration::from_secs(if std::env::var_os("ROOST_FULL").is_some() { 1 } else { 8 })
}

/// A value from `/metrics`.
fn metric(address: SocketAddr, name: &str) -> f64 {
    let (text, _) = ask(address, "/metrics");
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name}:\n{text}")).parse().unwrap()
}

/// A line of `/proc/PID/status` in bytes.
fn status_bytes(server: &Process, name: &str) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{}/status", server.id())).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap();
    line.trim_matches([':', ' ', '\t']).trim_end_matches("kB").trim().parse::<u64>().unwrap() * 1024
}

/// CPU time of a process in seconds.
fn processor_seconds(server: &Process) -> f64 {
    let text = std::fs::read_to_string(format!("/proc/{}/stat", server.id())).unwrap();
    let fields: Vec<_> = text.rsplit(')').next().unwrap().split_whitespace().collect();
    let ticks = |place: usize| fields[place].parse::<f64>().unwrap();
    (ticks(11) + ticks(12)) / 100.0
}

/// Raises the limit of open files of this process to its maximum. Returns the limit.
fn raise_descriptors() -> usize {
    let limit = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit }).unwrap();
    limit.maximum.map_or(usize::MAX, |maximum| maximum as usize)
}

#[test]
fn ten_thousand_incomplete_requests_do_not_block_other_clients() {
    let _alone = turn::alone();
    // As many as the limit of open files allows.
    let wanted = 10_000.min(raise_descriptors().saturating_sub(500));
    if wanted < 10_000 {
        println!("{wanted} half requests instead of 10,000: the limit of open files allows no more");
        assert!(
            std::env::var_os("ROOST_FULL").is_none(),
            "raise the limit of open files to 10,500 (ulimit -n)"
        );
    }
    assert!(wanted > 1000, "raise the limit of open files (ulimit -n)");
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let address = address(&sandbox);
    // A worker that is registered before the flood, and silent until its end.
    let worker = Client::new(&sandbox.address).unwrap();
    let me = WorkerId::new();
    let registration = WorkerRegistration {
        worker_id: me,
        name: "patient".to_owned(),
        api_version: API_VERSION.to_owned(),
        solver_revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "a test".to_owned(),
        threads: 1,
        memory_mib: None,
    };
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    runtime.block_on(worker.register(&registration)).unwrap();

    let (mut slowest, mut most) = (Duration::ZERO, 0);
    let mut halves = Vec::new();
    for number in 0..wanted {
        let half = runtime.block_on(async {
            // Separate addresses, so that other tests do not run out of ports.
            let socket = TcpSocket::new_v4().unwrap();
            let from = Ipv4Addr::new(127, 1, 0, (number / 1000) as u8 + 1);
            socket.bind(SocketAddr::new(IpAddr::V4(from), 0)).unwrap();
            let mut stream = socket.connect(address).await.unwrap();
            stream.write_all(HALF).await.unwrap();
            stream
        });
        halves.push(half);
        if number % 1000 == 999 {
            let (answer, took) = ask(address, "/healthz");
            assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
            slowest = slowest.max(took);
            most = most.max(status_bytes(&server, "VmRSS"));
        }
    }
    let opened = Instant::now();
    most = most.max(status_bytes(&server, "VmRSS"));
    let open = metric(address, "roost_connections");
    for _ in 0..5 {
        let (answer, took) = ask(address, "/v1/jobs");
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        slowest = slowest.max(took);
    }
    let mut buffer = [0; 1];
    for half in &halves {
        let closed = async {
            half.readable().await.unwrap();
            !matches!(half.try_read(&mut buffer), Err(error) if error.kind() == std::io::ErrorKind::WouldBlock)
        };
        runtime.block_on(async {
            let closed = tokio::time::timeout(Duration::from_secs(30), closed).await;
            assert!(closed.expect("the server closes it"));
        });
    }
    let closed = opened.elapsed();
    println!(
        "{wanted} half requests, {open} of them open at once: a new client was served within {slowest:?}, {} MiB resident, all \
         closed after {closed:?}",
        most / MIB
    );
    assert!(slowest < longest_answer(), "{slowest:?}");
    assert!(most < 150 * MIB, "{} MiB", most / MIB);
    assert!(closed < Duration::from_secs(25), "{closed:?}");
    assert!(open > 1000.0, "{open}: they were not there at once");

    // The connection is idle for longer than the timeout of the server; the client does not use it again.
    assert!(opened.elapsed() > Duration::from_secs(8), "all of that took {:?}", opened.elapsed());
    let idle = HeartbeatRequest { attempts: Vec::new() };
    let beat = worker.heartbeat(me, &idle, Duration::from_secs(10));
    runtime.block_on(beat).expect("nothing was lost on a closed connection");
}

/// A client that requests a file of more than a megabyte with a small receive buffer.
fn slow_reader(address: SocketAddr) -> TcpStream {
    use socket2::{Domain, Socket, Type};
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None).unwrap();
    // Small segments keep the send buffer of the server small.
    socket.set_tcp_mss(536).unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    socket.bind(&SocketAddr::from((Ipv4Addr::new(127, 1, 2, 1), 0)).into()).unwrap();
    socket.connect(&address.into()).unwrap();
    let mut stream = TcpStream::from(socket);
    stream.write_all(b"GET /docs/swagger-ui-bundle.js HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
    stream.set_nonblocking(true).unwrap();
    stream
}

#[test]
fn slow_readers_do_not_block_other_clients() {
    const LIMIT: usize = 64;
    let _alone = turn::alone();
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server_with(&["--max-connections", &LIMIT.to_string()]);
    let address = address(&sandbox);
    let is_over = Arc::new(AtomicBool::new(false));
    let reading = {
        let is_over = is_over.clone();
        std::thread::spawn(move || {
            let mut readers: Vec<_> = (0..4 * LIMIT)
                .map(|_| {
                    // A pause, so that most of them are answered before the next one.
                    std::thread::sleep(Duration::from_millis(2));
                    slow_reader(address)
                })
                .collect();
            while !is_over.load(Ordering::Relaxed) {
                for reader in &mut readers {
                    let _ = reader.read(&mut [0; 130]);
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        })
    };
    let (mut slowest, mut most, mut cut_off) = (Duration::ZERO, 0.0_f64, 0.0);
    let started = Instant::now();
    let is_long = |limit_s| started.elapsed() >= Duration::from_secs(limit_s);
    while !is_long(4) || (cut_off < LIMIT as f64 && !is_long(60)) {
        let (answer, took) = ask(address, "/v1/jobs");
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        slowest = slowest.max(took);
        most = most.max(metric(address, "roost_connections"));
        cut_off = metric(address, r#"roost_connections_refused_total{reason="unread"}"#);
        std::thread::sleep(Duration::from_millis(100));
    }
    is_over.store(true, Ordering::Relaxed);
    reading.join().unwrap();
    println!(
        "{} slow readers at {LIMIT} connections: at most {most} open, a new client was served within {slowest:?}",
        4 * LIMIT
    );
    assert!(most <= (LIMIT + 16) as f64, "{most} connections");
    assert!(slowest < longest_answer(), "{slowest:?}");
    assert!(cut_off >= LIMIT as f64, "{cut_off}");
}

#[test]
fn simultaneous_clients_are_all_served() {
    const CLIENTS: usize = 1500;
    let _alone = turn::alone();
    assert!(raise_descriptors() > CLIENTS + 500);
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let address = address(&sandbox);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let asked = move || async move {
        let socket = TcpSocket::new_v4()?;
        socket.bind((Ipv4Addr::new(127, 1, 1, 1), 0).into())?;
        let mut stream = socket.connect(address).await?;
        stream.write_all(b"GET /v1/version HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").await?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).await?;
        std::io::Result::Ok(answer)
    };
    let all: Vec<_> = (0..CLIENTS).map(|_| runtime.spawn(asked())).collect();
    for client in all {
        let answer = runtime.block_on(client).unwrap().unwrap();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    }
    assert_eq!(metric(address, r#"roost_connections_refused_total{reason="no_request"}"#), 0.0);
}

#[test]
fn clients_close_idle_connections_before_the_server() {
    assert!(ServerConfig::default().head_timeout >= 2 * MAX_IDLE);
}

#[test]
fn unknown_methods_use_no_memory_and_no_metrics() {
    let all = if std::env::var_os("ROOST_FULL").is_some() { 100_000 } else { 20_000 };
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let address = address(&sandbox);
    let invent = |numbers: std::ops::Range<usize>| {
        let mut stream = TcpStream::connect(address).unwrap();
        let numbers: Vec<_> = numbers.collect();
        for batch in numbers.chunks(50) {
            let mut requests = String::new();
            for number in batch {
                // Some have the maximum length of a header.
                let more = "X".repeat(if number % 50 == 0 { 15_000 } else { 10 });
                requests += &format!("M{number}{more} /v1/jobs HTTP/1.1\r\nhost: localhost\r\n\r\n");
            }
            // Written and read in parallel, since full buffers would block both sides.
            let mut writer = stream.try_clone().unwrap();
            let written = std::thread::spawn(move || writer.write_all(requests.as_bytes()));
            let (mut answers, mut buffer, mut seen) = (0, [0; 64 * 1024], Vec::new());
            while answers < batch.len() {
                let read = stream.read(&mut buffer).unwrap();
                assert!(read > 0, "the server closed the connection after {answers} answers");
                seen.extend_from_slice(&buffer[..read]);
                let text = String::from_utf8_lossy(&seen);
                answers = text.matches("HTTP/1.1 405").count();
            }
            written.join().unwrap().unwrap();
        }
    };
    let known = ["GET", "POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE"];
    let (spec, _) = ask(address, "/openapi.json");
    let spec: serde_json::Value = serde_json::from_str(spec.split_once("\r\n\r\n").unwrap().1).unwrap();
    let client = |method: &str, path: &str| {
        let mut stream = TcpStream::connect(address).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").unwrap();
        let _ = stream.read(&mut [0; 64]);
    };
    // Known methods first, whose metrics are permanent.
    for path in spec["paths"].as_object().unwrap().keys() {
        known.iter().for_each(|method| client(method, path));
    }
    invent(0..2000);
    let before = status_bytes(&server, "VmRSS");
    invent(2000..2000 + all);
    let grown = status_bytes(&server, "VmRSS").saturating_sub(before);
    let (scrape, _) = ask(address, "/metrics");
    println!("{all} invented methods: {} KiB more memory, a scrape of {} bytes", grown / 1024, scrape.len());
    assert!(grown <= 5 * MIB, "{grown} bytes for {all} methods");
    assert!(scrape.len() <= 200_000, "{} bytes", scrape.len());
    let counted = format!(
        r#"roost_http_requests_total{{method="other",route="/v1/jobs",status="405"}} {}"#,
        all + 2000
    );
    assert!(scrape.lines().any(|line| line == counted), "{counted}\n{scrape}");
}

#[test]
fn server_with_open_streams_and_incomplete_requests_stops_in_time() {
    let _alone = turn::alone();
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let address = address(&sandbox);
    let job = sandbox.submit(&support::hopper_scenario(1.0));
    let mut open = Vec::new();
    for head in [
        format!("GET /v1/jobs/{}/events HTTP/1.1\r\nhost: localhost\r\n\r\n", job.id),
        "GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n".to_owned(),
    ] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(head.as_bytes()).unwrap();
        assert!(stream.read(&mut [0; 256]).unwrap() > 0);
        open.push(stream);
    }
    for _ in 0..100 {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(HALF).unwrap();
        open.push(stream);
    }
    // A body that never arrives.
    let mut stream = TcpStream::connect(address).unwrap();
    let head = "POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: 9\r\n\r\n{";
    stream.write_all(head.as_bytes()).unwrap();
    wait_until("all are there", || (metric(address, "roost_connections") >= 104.0).then_some(()));
    let stopped = Instant::now();
    server.terminate();
    let (status, _) = server.wait();
    assert!(
        status.success() && stopped.elapsed() < Duration::from_secs(8),
        "{status} {:?}",
        stopped.elapsed()
    );
}
