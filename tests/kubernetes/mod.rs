//! The manifests in `deploy/kubernetes/`, read as text. `check.sh` in this folder checks them against the schemas.

mod postgres;

use std::collections::BTreeSet;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Command;

use serde_json::Value;

use crate::support::{self, Process, Sandbox};
use crate::{deploy, instructions};

fn read(name: &str) -> String {
    std::fs::read_to_string(deploy("kubernetes").join(name)).unwrap()
}

/// The rest of the first line with a key.
fn value<'a>(text: &'a str, key: &str) -> &'a str {
    let (_, rest) = text.split_once(key).unwrap_or_else(|| panic!("no {key}"));
    rest.lines().next().unwrap()
}

/// The words of a list in brackets after a key, such as `args: ["serve"]`.
fn words(text: &str, key: &str) -> Vec<String> {
    serde_json::from_str(value(text, key)).unwrap()
}

fn indent(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

/// The text of each container from its image on.
fn containers(manifest: &str) -> Vec<String> {
    let lines: Vec<&str> = manifest.lines().collect();
    let starts = (0..lines.len()).filter(|at| lines[*at].trim_start().starts_with("image: "));
    let text_from = |at: usize| -> String {
        let own = lines[at..].iter().take_while(|line| indent(line) >= indent(lines[at]));
        own.map(|line| format!("{line}\n")).collect()
    };
    starts.map(text_from).collect()
}

/// The script of a container, a block of indented lines.
fn script(container: &str) -> String {
    let (_, text) = container.split_once("- |\n").expect("a block");
    let margin = " ".repeat(indent(text.lines().next().unwrap()));
    let lines = text.lines().map_while(|line| line.strip_prefix(&margin));
    lines.map(|line| format!("{line}\n")).collect()
}

/// Runs the script of a first container in a folder as its volume.
fn run_first(volume: &Path, container: &str, variables: &[(&str, &str)]) {
    let bin = Path::new(env!("CARGO_BIN_EXE_roost")).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    let command = words(container, "command: ");
    let secret = volume.join("secret").display().to_string();
    let script = script(container).replace("/run/secrets/roost", &secret);
    let mut shell = Command::new(&command[0]);
    shell.args(&command[1..]).arg(script).current_dir(volume).env("PATH", &path);
    let output = shell.envs(variables.iter().copied()).output().unwrap();
    assert!(output.status.success(), "{}", support::transcript(&output));
}

#[test]
fn every_manifest_is_applied() {
    let folders = [("", Some("maintenance.yaml")), ("workers/", None), ("postgres/", None), ("keda/", None)];
    for (folder, by_hand) in folders {
        let entries = std::fs::read_dir(deploy("kubernetes").join(folder)).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let found: BTreeSet<String> = names.filter(|name| name.ends_with(".yaml")).collect();
        let text = read(&format!("{folder}kustomization.yaml"));
        let (_, listed) = text.split_once("\nresources:\n").expect("resources");
        let listed = listed.lines().map_while(|line| line.strip_prefix("  - "));
        let (files, others): (Vec<&str>, Vec<&str>) = listed.partition(|name| name.ends_with(".yaml"));
        let expected = files.into_iter().chain(by_hand).chain(["kustomization.yaml"]);
        assert_eq!(found, expected.map(str::to_owned).collect::<BTreeSet<_>>(), "{folder}");
        for other in others {
            assert!(
                deploy("kubernetes").join(folder).join(other).join("kustomization.yaml").exists(),
                "{other}"
            );
        }
    }
}

#[test]
fn every_container_is_confined() {
    let user = instructions("USER")[0].clone();
    let own = user.split_once(':').unwrap();
    let image = format!("roost:{}", env!("CARGO_PKG_VERSION"));
    let foreign =
        ("postgres/database.yaml", ("999", "999"), "docker.io/library/postgres:17-bookworm".to_owned());
    let of_roost = ["server.yaml", "workers/workers.yaml", "maintenance.yaml", "postgres/servers.yaml"];
    for (name, (uid, gid), image) in
        of_roost.map(|name| (name, own, image.clone())).into_iter().chain([foreign])
    {
        let manifest = read(name);
        let of_pod = [
            "automountServiceAccountToken: false",
            "enableServiceLinks: false",
            "runAsNonRoot: true",
            &format!("runAsUser: {uid}"),
            &format!("runAsGroup: {gid}"),
            "type: RuntimeDefault",
        ];
        for line in of_pod {
            assert_eq!(manifest.matches(&format!(" {line}\n")).count(), 1, "{name}: {line}");
        }
        let all = containers(&manifest);
        assert!(!all.is_empty(), "{name}");
        let of_container = [
            "allowPrivilegeEscalation: false",
            "readOnlyRootFilesystem: true",
            r#"drop: ["ALL"]"#,
            "requests:",
            "limits:",
        ];
        for container in all {
            assert!(container.contains(&format!("image: {image}\n")), "{name}: {container}");
            for line in of_container {
                assert!(container.contains(&format!(" {line}\n")), "{name}: {line}: {container}");
            }
        }
        for word in ["hostPath", "hostNetwork", "privileged", "runAsUser: 0"] {
            assert!(!manifest.contains(word), "{name}: {word}");
        }
    }
}

#[test]
fn addresses_and_names_agree() {
    let (server, workers, keda) =
        (read("server.yaml"), read("workers/workers.yaml"), read("keda/scaled-object.yaml"));
    let command = words(containers(&server).last().unwrap(), "args: ");
    let listen = command.iter().skip_while(|word| *word != "--listen").nth(1).unwrap();
    let listen: SocketAddr = listen.parse().unwrap();
    assert!(!listen.ip().is_loopback(), "{listen}");
    let port = listen.port();
    assert!(server.contains(&format!(" containerPort: {port}\n")), "{port}");
    let (_, service) = server.split_once("kind: Service\n").unwrap();
    assert_eq!(value(service, " port: "), port.to_string());
    let service = value(service, "\n  name: ");
    assert_eq!(value(&workers, " value: "), format!("http://{service}:{port}"));
    assert_eq!(value(&keda, " url: "), format!("http://{service}.default.svc:{port}/v1/queue/depth"));
    let (_, target) = keda.split_once("scaleTargetRef:\n").unwrap();
    assert_eq!(value(target, "name: "), value(&workers, "\n  name: "));
    let claim = format!("data-{}-0", value(&server, "\n  name: "));
    assert_eq!(value(&read("maintenance.yaml"), "claimName: "), claim);
    // The scaler reads a number that the API has.
    let api = std::fs::read_to_string(deploy("../api.md")).unwrap();
    let (_, section) = api.split_once("### GET /v1/queue/depth\n").unwrap();
    let section = section.split("\n### ").next().unwrap();
    let number = format!("\"{}\": ", value(&keda, "valueLocation: "));
    assert!(section.contains(&number), "{number}");
}

#[test]
fn pods_start_with_their_commands() {
    let sandbox = Sandbox::new();
    let volume = sandbox.path("volume");
    std::fs::create_dir(&volume).unwrap();
    let manifest = read("server.yaml");
    let of_server = containers(&manifest);
    assert_eq!(of_server.len(), 2);

    // The first container makes tokens once.
    let make_tokens = || -> String {
        run_first(&volume, &of_server[0], &[]);
        std::fs::read_to_string(volume.join("tokens/admin")).unwrap()
    };
    let admin = make_tokens();
    assert_eq!(make_tokens(), admin);
    // No more once an operator has removed their secrets.
    std::fs::rename(volume.join("tokens"), volume.join("taken")).unwrap();
    run_first(&volume, &of_server[0], &[]);
    assert!(!volume.join("tokens").exists());
    std::fs::rename(volume.join("taken"), volume.join("tokens")).unwrap();

    let (data, port) = (volume.display().to_string(), sandbox.address.rsplit_once(':').unwrap().1);
    let here = |word: &String| word.replace("/var/lib/roost", &data).replace(":7373", &format!(":{port}"));
    let command: Vec<String> = words(&of_server[1], "args: ").iter().map(here).collect();
    let server = Process::start(support::roost().args(&command), sandbox.path("server.log"));
    support::wait_until("the server is ready", || sandbox.answers("/readyz", 200).then_some(()));
    let probes = manifest.lines().filter_map(|line| line.trim_start().strip_prefix("path: "));
    let probes: Vec<&str> = probes.collect();
    assert_eq!(probes.len(), 3);
    for probe in probes {
        assert!(sandbox.answers(probe, 200), "{probe}");
    }

    let state = sandbox.path("state").display().to_string();
    let token = volume.join("tokens/worker").display().to_string();
    let here =
        |word: &String| word.replace("/var/lib/roost", &state).replace("/run/secrets/roost/token", &token);
    let command = words(&containers(&read("workers/workers.yaml"))[0], "args: ");
    let command: Vec<String> = command.iter().map(here).collect();
    let mut worker = support::roost();
    worker.args(&command).env("ROOST_SERVER", &sandbox.address);
    let worker = Process::start(&mut worker, sandbox.path("worker.log"));
    support::wait_until("the worker is connected", || {
        let mut list = support::roost();
        list.args(["list", "--workers", "--json", "--server", &sandbox.address]).env("ROOST_TOKEN", &admin);
        let workers: Value = serde_json::from_str(&support::stdout(&list.output().unwrap())).unwrap();
        (workers["items"].as_array().unwrap().len() == 1).then_some(())
    });
    for process in [worker, server] {
        process.terminate();
        let (status, _) = process.wait();
        assert!(status.success(), "{status}");
    }

    // A server of which all tokens are revoked could not start.
    let data = volume.join("data").display().to_string();
    let tokens = support::stdout(&support::run(&["token", "list", "--json", "--data", &data]));
    let tokens: Value = serde_json::from_str(&tokens).unwrap();
    for token in tokens.as_array().unwrap() {
        let revoked = support::run(&["token", "revoke", token["id"].as_str().unwrap(), "--data", &data]);
        assert!(revoked.status.success(), "{}", support::transcript(&revoked));
    }
    assert_ne!(make_tokens(), admin);
}
