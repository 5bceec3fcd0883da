//! File descriptors: how many the server asks for, and what it does when there are none left.

use super::*;

/// Sets the limit of open files of a running process.
fn limit_descriptors(server: &Process, limit: usize) {
    let pid = server.id().to_string();
    let set = Command::new("prlimit").args(["--pid", &pid, &format!("--nofile={limit}:")]).status().unwrap();
    assert!(set.success());
}

#[test]
fn a_server_without_file_descriptors_neither_ends_nor_spins_and_makes_room() {
    let _alone = undisturbed();
    let home = Home::new();
    let server = home.serve();
    let address = address(&home);
    let open = std::fs::read_dir(format!("/proc/{}/fd", server.id())).unwrap().count();
    limit_descriptors(&server, open + 10);
    let halves: Vec<_> = (0..30)
        .map(|_| {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.write_all(HALF).unwrap();
            stream
        })
        .collect();
    until("the server has no file descriptor left", || {
        server.log().contains("no connection can be accepted").then_some(())
    });
    let before = processor_seconds(&server);
    std::thread::sleep(Duration::from_secs(1));
    let taken = processor_seconds(&server) - before;
    assert!(taken < 0.5, "{taken} s of processor time in a second of waiting");
    let (answer, took) = ask(address, "/healthz");
    assert!(answer.starts_with("HTTP/1.1 200") && took < Duration::from_secs(5), "{took:?} {answer}");
    drop(halves);
    server.terminate();
    let (status, took) = server.wait();
    assert!(status.success() && took < Duration::from_secs(5), "{status} after {took:?}");
}

#[test]
fn the_limit_of_open_files_is_raised_and_connections_keep_to_it() {
    let home = Home::new();
    let listen = home.address.trim_start_matches("http://");
    let mut command = Command::new("prlimit");
    command.args(["--nofile=128:1024", env!("CARGO_BIN_EXE_roost"), "serve", "--listen", listen, "--data"]);
    let server = Process::start(command.arg(home.path("data")), home.path("serve.log"));
    let address = address(&home);
    until("the server answers", || TcpStream::connect(address).ok());
    let found = (metric(address, "process_max_fds"), metric(address, "roost_connections_limit"));
    assert_eq!(found, (1024.0, 720.0));
    assert!(server.log().contains("max_connections is reduced"), "{}", server.log());
}

#[test]
fn the_limit_of_open_files_is_raised_no_further_than_connections_need() {
    let home = Home::new();
    let listen = home.address.trim_start_matches("http://");
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
    let _server = Process::start(command.arg(home.path("data")), home.path("serve.log"));
    let address = address(&home);
    until("the server answers", || TcpStream::connect(address).ok());
    let max = metric(address, "process_max_fds");
    assert!((2000.0..2200.0).contains(&max), "{max}");
    assert_eq!(metric(address, "roost_connections_limit"), 1500.0);
}
