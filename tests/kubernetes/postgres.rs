//! The manifests in `deploy/kubernetes/postgres/`: two servers, PostgreSQL and a bucket.

use std::path::Path;
use std::process::Output;

use super::{containers, read, run_first, value, words};
use crate::cluster::Cluster;
use crate::support::{self, Process, Sandbox};

/// The values of a variable in all containers of a manifest.
fn values(manifest: &str, variable: &str) -> Vec<String> {
    let mark = format!("- name: {variable}\n");
    manifest.split(&mark).skip(1).map(|rest| value(rest, "value: ").to_owned()).collect()
}

/// The address of PostgreSQL in the manifests, as user, host and database.
fn address() -> [String; 3] {
    let all = values(&read("postgres/servers.yaml"), "ROOST_DATABASE");
    assert!(all.len() == 2 && all[0] == all[1], "every container that needs the database has it: {all:?}");
    let rest = all[0].strip_prefix("postgres://").unwrap();
    let (user, rest) = rest.split_once('@').unwrap();
    let (host, database) = rest.split_once('/').unwrap();
    [user, host, database].map(str::to_owned)
}

#[test]
fn servers_find_the_database_the_bucket_and_each_other() {
    let (servers, database) = (read("postgres/servers.yaml"), read("postgres/database.yaml"));
    let [user, host, name] = address();
    let (_, service) = database.split_once("kind: Service\n").unwrap();
    assert_eq!(value(service, "\n  name: "), host);
    assert_eq!(value(service, " port: "), "5432");
    assert_eq!(values(&database, "POSTGRES_USER"), [user.as_str()]);
    assert_eq!(values(&database, "POSTGRES_DB"), [name.as_str()]);
    assert!(database.contains(&format!("--username={user}\"]")), "the probe");
    // One secret has the password of both sides.
    let keys = servers
        .matches("secretKeyRef:\n                  name: roost-postgres\n                  key: password\n");
    assert_eq!(keys.count(), 2);
    assert_eq!(value(&database, "secretName: "), "roost-postgres");
    let mounted = values(&database, "POSTGRES_PASSWORD_FILE");
    let (_, mount) = database.split_once("- name: password\n              mountPath: ").unwrap();
    assert_eq!(mounted, [format!("{}/password", mount.lines().next().unwrap())]);
    // The data are below the mounted volume.
    let (_, mount) = database.split_once("- name: data\n              mountPath: ").unwrap();
    assert!(values(&database, "PGDATA")[0].starts_with(&format!("{}/", mount.lines().next().unwrap())));

    // The name of each pod belongs to the service of the stateful set, which knows pods that are not ready.
    let server = containers(&servers).pop().unwrap();
    let command = words(&server, "args: ");
    let option = |name: &str| command.iter().skip_while(|word| *word != name).nth(1).unwrap();
    let set = value(&servers, "serviceName: ");
    assert_eq!(*option("--advertise"), format!("$(POD_NAME).{set}:7373"));
    assert!(server.contains("fieldPath: metadata.name\n"));
    let of_set = servers
        .split("\n---\n")
        .find(|part| part.contains(&format!("kind: Service\nmetadata:\n  name: {set}\n")));
    let of_set = of_set.expect("the service of the stateful set");
    assert!(of_set.contains("clusterIP: None\n") && of_set.contains("publishNotReadyAddresses: true\n"));
    assert_eq!(option("--objects"), "$(BUCKET)");
    assert!(server.contains("envFrom:\n            - secretRef:\n                name: roost-bucket\n"));
    // Clients and workers use the same service as with SQLite.
    assert!(servers.contains("kind: Service\nmetadata:\n  name: roost\n"));
    // A drain leaves one of the servers.
    assert_eq!(value(&servers, "  replicas: "), "2");
    assert_eq!(value(&servers, "minAvailable: "), "1");
}

/// A server of the manifest here: with an address and a folder of its own, and without a bucket.
struct Pod {
    sandbox: Sandbox,
    name: String,
    volume: std::path::PathBuf,
    database: String,
}

impl Pod {
    fn new(number: u32, database: &str) -> Self {
        let sandbox = Sandbox::new();
        let volume = sandbox.path("volume");
        std::fs::create_dir(&volume).unwrap();
        Self { sandbox, name: format!("roost-serve-{number}"), volume, database: database.to_owned() }
    }

    fn make_tokens(&self) {
        let container = &containers(&read("postgres/servers.yaml"))[0];
        run_first(&self.volume, container, &[("POD_NAME", &self.name), ("ROOST_DATABASE", &self.database)]);
    }

    fn token(&self, name: &str) -> Option<String> {
        std::fs::read_to_string(self.volume.join("tokens").join(name)).ok()
    }

    /// Its command. The test build has no support for buckets, so that both pods have one folder of objects.
    fn command(&self, data: &Path) -> std::process::Command {
        let container = containers(&read("postgres/servers.yaml")).pop().unwrap();
        let mut arguments = words(&container, "args: ");
        let bucket = arguments.iter().position(|word| word == "--objects").unwrap();
        arguments.drain(bucket..bucket + 2);
        let port = self.sandbox.address.rsplit_once(':').unwrap().1;
        let here = |word: &String| {
            let word =
                word.replace(":7373", &format!(":{port}")).replace("$(POD_NAME).roost-servers", "127.0.0.1");
            word.replace("/var/lib/roost/data", &data.display().to_string())
        };
        let mut command = support::roost();
        command.args(arguments.iter().map(here)).env("ROOST_DATABASE", &self.database);
        command
    }

    fn start(&self, data: &Path) -> Process {
        let server = Process::start(&mut self.command(data), self.sandbox.path("server.log"));
        support::wait_until("the server is ready", || self.sandbox.answers("/readyz", 200).then_some(()));
        server
    }

    fn list(&self, token: &str) -> Output {
        let mut list = support::roost();
        list.args(["list", "--json", "--server", &self.sandbox.address]).env("ROOST_TOKEN", token);
        list.output().unwrap()
    }
}

#[test]
fn servers_of_one_database_start_with_their_commands() {
    let postgres = Cluster::start(&std::env::temp_dir(), "");
    let database = postgres.create("roost");
    let pods = [0, 1].map(|number| Pod::new(number, &database));
    let data = pods[0].volume.join("data");
    let refused = pods[1].command(&data).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "without a token: {}", support::transcript(&refused));

    // Only the first pod makes tokens, and only once.
    pods[1].make_tokens();
    pods[0].make_tokens();
    let (admin, worker) = (pods[0].token("admin").unwrap(), pods[0].token("worker").unwrap());
    pods[0].make_tokens();
    assert_eq!((pods[0].token("admin"), pods[1].token("admin")), (Some(admin.clone()), None));

    let [first, second] = [0, 1].map(|index| pods[index].start(&data));
    support::wait_until("it stands by", || second.log().contains("requests are passed on").then_some(()));
    for pod in &pods {
        assert!(pod.list(&admin).status.success());
        assert_eq!(pod.list(&worker).status.code(), Some(1), "a worker may not list");
    }
    first.terminate();
    assert!(first.wait().0.success());
    support::wait_until("the second server leads", || pods[1].list(&admin).status.success().then_some(()));

    // A pod that starts elsewhere finds the token in the secret, and makes no other.
    let moved = Pod::new(0, &database);
    std::fs::create_dir(moved.volume.join("secret")).unwrap();
    std::fs::write(moved.volume.join("secret/token"), worker).unwrap();
    moved.make_tokens();
    assert_eq!(moved.token("admin"), None);
    let _first = moved.start(&data);
    assert!(moved.list(&admin).status.success());
}
