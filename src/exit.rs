//! Exit codes and hints of errors.

use std::io;

use roost_server::ServerError;
use roost_terminal::{BadInput, Exit};
use roost_worker::client::ClientError;

/// For the end of `--help`.
pub(crate) const HELP: &str = "\
Exit codes:
  0  success
  1  failed, or stopped before the end
  2  wrong usage or bad input
  3  the simulation diverged (unstable)

Environment:
  ROOST_SERVER  address of the server, instead of --server
  ROOST_TOKEN   access token, if the server requires one and --token-file is not given
  ROOST_CA      file with certificates to trust for https, instead of --ca
  ROOST_LOG     log filter, such as `info` or `roost_worker=debug`
  ROOST_LOG_FORMAT  `text` or `json`, instead of --log-format";

/// The exit code of an error.
pub(crate) fn code(error: &anyhow::Error) -> Exit {
    if error.chain().any(is_bad_input) { Exit::BadInput } else { Exit::Failed }
}

fn is_bad_input(cause: &(dyn std::error::Error + 'static)) -> bool {
    let is_client_input = |error: &ClientError| {
        matches!(error, ClientError::Address(_) | ClientError::Authorities(_))
            || matches!(error.problem_status(), Some(400 | 404 | 413 | 415 | 422))
    };
    // An address or a data folder that the server cannot use.
    let is_server_input = |error: &ServerError| {
        matches!(error, ServerError::NotLoopback(_) | ServerError::Bind { .. } | ServerError::Data(_))
    };
    cause.is::<BadInput>()
        || cause.downcast_ref().is_some_and(is_client_input)
        || cause.downcast_ref().is_some_and(is_server_input)
}

/// Advice on an error whose text has none.
pub(crate) fn hint(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| {
        if let Some(ClientError::Unreachable { is_refused: true, .. }) = cause.downcast_ref() {
            return Some(
                "`roost up` or `roost serve` starts a server; `--server` or ROOST_SERVER names a server elsewhere",
            );
        }
        match cause.downcast_ref() {
            Some(ServerError::NotLoopback(_)) => Some(
                "in a container, create the token on its volume first: `podman run --rm -v VOLUME:/var/lib/roost IMAGE token create \
                 --data /var/lib/roost --scope admin > admin.token`",
            ),
            Some(ServerError::Bind { source, .. }) if source.kind() == io::ErrorKind::AddrInUse => {
                Some("another server may use this port; `--listen 127.0.0.1:0` takes any free port")
            }
            _ => None,
        }
    })
}
