//! Exit codes: documented in the help, the same in every subcommand.

use std::io;
use std::process::ExitCode;

use roost_server::ServerError;
use roost_worker::client::ClientError;

/// For the end of `--help`.
pub(crate) const HELP: &str = "\
Exit codes:
  0  done
  1  it failed, or was stopped before its end
  2  wrong usage or bad input
  3  the physics diverged (unstable)

Environment:
  ROOST_SERVER  address of the server, in place of --server
  ROOST_TOKEN   access token, where the server wants one and --token-file is not given
  ROOST_CA      file of certificates to trust over https, in place of --ca
  ROOST_LOG     what is logged to stderr, such as `info` or `roost_worker=debug`
  ROOST_LOG_FORMAT  `text` or `json`, in place of --log-format";

/// How the command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    Done = 0,
    Failed = 1,
    BadInput = 2,
    Unstable = 3,
}

impl Exit {
    /// The code of an error: bad input is told apart from everything else.
    pub(crate) fn of(error: &anyhow::Error) -> Self {
        let is_bad_input = error.chain().any(|cause| {
            let refused = cause.downcast_ref::<ClientError>();
            cause.is::<BadInput>()
                || cause.downcast_ref::<ServerError>().is_some_and(cannot_start)
                || refused.is_some_and(|refused| {
                    matches!(refused, ClientError::Address(_) | ClientError::Authorities(_))
                        || matches!(refused.problem_status(), Some(400 | 404 | 413 | 415 | 422))
                })
        });
        if is_bad_input { Self::BadInput } else { Self::Failed }
    }
}

/// What to do about an error, where that is not in it.
pub(crate) fn hint(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| {
        if let Some(ClientError::Unreachable { is_refused: true, .. }) = cause.downcast_ref() {
            return Some("`roost up` or `roost serve` starts a server; `--server` or ROOST_SERVER names one that runs elsewhere");
        }
        match cause.downcast_ref() {
            Some(ServerError::NotLoopback(_)) => Some(
                "in a container, make the token on its volume first: `podman run --rm -v VOLUME:/var/lib/roost IMAGE token create \
                 --data /var/lib/roost --scope admin > admin.token`",
            ),
            Some(ServerError::Bind { source, .. }) if source.kind() == io::ErrorKind::AddrInUse => {
                Some("a server may run there already; `--listen 127.0.0.1:0` takes any port that is free")
            }
            _ => None,
        }
    })
}

/// An address or a folder that a server was told to use and cannot.
fn cannot_start(error: &ServerError) -> bool {
    use ServerError::{Bind, Data, NotLoopback};
    matches!(error, NotLoopback(_) | Bind { .. } | Data(_))
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Whether whoever read our output has gone: `roost list | head` is no failure.
pub(crate) fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let is_so = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref::<io::Error>().is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    };
    error.chain().any(is_so)
}

/// What the user gave cannot be used; says why.
#[derive(Debug)]
pub(crate) struct BadInput(pub(crate) String);

impl std::fmt::Display for BadInput {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadInput {}
