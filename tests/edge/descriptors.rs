//! File descriptors: the limit that the server sets, and its behaviour without free descriptors.

use super::*;

/// Sets the limit of open files of a running process.
fn limit_descriptors(server: &Process, limit: usize) {
    let pid = server.id().to_string();
    let set = Command::new("prlimit").args(["--pid", &pid, &format!("--nofile={limit}:")]).status().unwrap();
    assert!(set.success());
}

#[test]
fn server_without_file_descriptors_survives_and_closes_idle_connections() {
    let _alone = turn::alone();
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let address = address(&sandbox);
    let open = std::fs::read_dir(format!("/proc/{}/fd", server.id())).unwrap().count();
    limit_descriptors(&server, open + 10);
    let halves: Vec<_> = (0..30)
        .map(|_| {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.write_all(HALF).unwrap();
            stream
        })
        .collect();
    wait_until("the server has no file descriptor left", || {
        server.log().contains("no connection can be accepted").then_some(())
    });
    let (before, since) = (processor_seconds(&server), Instant::now());
    std::thread::sleep(Duration::from_secs(1));
    let (taken, waited_s) = (processor_seconds(&server) - before, since.elapsed().as_secs_f64());
    assert!(taken < 0.5 * waited_s, "{taken} s of processor time in {waited_s} s of waiting");
    let (answer, took) = ask(address, "/healthz");
    assert!(answer.starts_with("HTTP/1.1 200") && took < Duration::from_secs(9), "{took:?} {answer}");
    drop(halves);
    server.terminate();
    let (status, took) = server.wait();
    assert!(status.success() && took < Duration::from_secs(15), "{status} after {took:?}");
}

#[test]
fn open_file_limit_is_raised_and_bounds_connections() {
    let sandbox = Sandbox::new();
    let listen = sandbox.address.trim_start_matches("http://");
    let mut command = Command::new("prlimit");
    command.args(["--nofile=128:1024", env!("CARGO_BIN_EXE_roost"), "serve", "--listen", listen, "--data"]);
    let server = Process::start(command.arg(sandbox.path("data")), sandbox.path("serve.log"));
    let address = address(&sandbox);
    wait_until("the server answers", || TcpStream::connect(address).ok());
    let found = (metric(address, "process_max_fds"), metric(address, "roost_connections_limit"));
    assert_eq!(found, (1024.0, 720.0));
    assert!(server.log().contains("max_connections is reduced"), "{}", server.log());
}

#[test]
fn open_file_limit_is_raised_only_as_far_as_needed() {
    let sandbox = Sandbox::new();
    let listen = sandbox.address.trim_start_matches("http://");
    let hard = raise_descriptors();
    assert!(hard > 3000);
    let mut command = Command::new("prlimit");
    command.args([
        &format!("--nofile=1024:{hard}"),
        env!("CARGO_BIN_EXE_roost"),
        "serve",
        "--max-connections",
        "1500",
    ]);
    command.args(["--listen", listen, "--data"]);
    let _server = Process::start(command.arg(sandbox.path("data")), sandbox.path("serve.log"));
    let address = address(&sandbox);
    wait_until("the server answers", || TcpStream::connect(address).ok());
    let max = metric(address, "process_max_fds");
    assert!((2000.0..2200.0).contains(&max), "{max}");
    assert_eq!(metric(address, "roost_connections_limit"), 1500.0);
}
