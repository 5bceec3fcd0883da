//! An identity provider of its own for a test: a process of Canaille with users `ada`, `bob` and `eve`.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// The password of every user.
pub(crate) const PASSWORD: &str = "correct horse";

/// The secret of every client.
pub(crate) const CLIENT_SECRET: &str = "secret of the client";

/// The process, which is killed at the end of the test.
pub(crate) struct Provider {
    /// Its issuer. No page of a server is of the same site.
    pub(crate) issuer: String,
    process: Child,
}

impl Provider {
    /// Starts one that knows the server at this address.
    pub(crate) fn start(server: &str) -> Self {
        let test = std::env::current_exe().unwrap();
        let target = test.ancestors().nth(3).expect("target/debug/deps");
        let python: PathBuf = target.join("tools/provider/bin/python");
        assert!(python.exists(), "{} is missing: `make python-tools` installs it", python.display());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sign_in/provider.py");
        let command =
            Command::new(python).arg(script).arg(server).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut process = command.unwrap();
        let mut issuer = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut issuer).unwrap();
        let issuer = issuer.trim().to_owned();
        assert!(issuer.starts_with("http://"), "the provider has not started: {issuer:?}");
        Self { issuer, process }
    }

    /// Options of a server that trusts it. `secret`: a file that this writes.
    pub(crate) fn options(&self, server: &str, secret: &Path) -> Vec<String> {
        std::fs::write(secret, format!("{CLIENT_SECRET}\n")).unwrap();
        let secret = secret.display().to_string();
        [
            "--oidc-issuer",
            &self.issuer,
            "--oidc-client-id",
            "roost",
            "--oidc-client-secret-file",
            &secret,
            "--oidc-redirect",
            server,
        ]
        .map(str::to_owned)
        .to_vec()
    }
}

impl Drop for Provider {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
