//! Errors between a client and the server, with advice.

use std::io;

use roost_api::printable::{fault_line, one_line};
use roost_api::problem::Problem;

use super::reason;

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address is invalid.
    #[error("`{0}` is not a server address: write it like http://127.0.0.1:7373")]
    Address(String),
    /// The token cannot be sent.
    #[error("the access token has invalid characters")]
    Token,
    /// The file of authorities cannot be used, for this reason.
    #[error("the file of certificates to trust (--ca or ROOST_CA) cannot be used: {0}")]
    Authorities(String),
    /// The system has no authorities to check the server's certificate.
    #[error(
        "cannot check the certificate of {server}: {reason}. Install the system's certificates (Debian: ca-certificates), \
         or name the file with the certificate of the server's authority with --ca FILE or ROOST_CA"
    )]
    NoAuthorities {
        /// Address of the server.
        server: String,
        /// The missing certificates, in words.
        reason: String,
    },
    /// The server sends its clients to another address.
    #[error("{server} redirects to {location}: give the address that serves Roost itself")]
    Redirected {
        /// Address of the server.
        server: String,
        /// Where it redirects to.
        location: String,
    },
    /// A file to send cannot be read, or a received file cannot be written.
    #[error("cannot use {}: {reason}", path.display())]
    File {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        reason: String,
    },
    /// No answer, or none in time. A retry may help.
    #[error("cannot reach {server}: {}", one_line(reason))]
    Unreachable {
        /// Address of the server.
        server: String,
        /// The innermost cause, such as `Connection refused`, and what to do about it where that is known.
        reason: String,
        /// Whether the connection was refused: no process listens there.
        is_refused: bool,
    },
    /// The server answered with a problem.
    #[error("{}", describe(.0))]
    Problem(Box<Problem>),
    /// An error answer without a problem document: another program answers there.
    #[error("{server} answered {status} without a reason: {}{}", one_line(body), reason::explain_answer(server, *status, body))]
    Foreign {
        /// Address of the server.
        server: String,
        /// HTTP status.
        status: u16,
        /// Start of the body.
        body: String,
    },
    /// A success with an unexpected body.
    #[error("{server} sent an answer that this version of roost cannot read: {}", one_line(reason))]
    Body {
        /// Address of the server.
        server: String,
        /// The fault of the body.
        reason: String,
    },
}

impl ClientError {
    /// Whether the same call may succeed later: the server does not answer, is overloaded or restarts.
    pub fn is_transient(&self) -> bool {
        match self {
            Self::Address(_)
            | Self::Token
            | Self::Authorities(_)
            | Self::NoAuthorities { .. }
            | Self::Redirected { .. }
            | Self::File { .. } => false,
            Self::Unreachable { .. } | Self::Body { .. } => true,
            Self::Foreign { status, .. } => is_transient_status(*status) || *status == 404,
            Self::Problem(problem) => is_transient_status(problem.status),
        }
    }

    /// Whether no server listens, or the server says that it cannot take requests now.
    pub fn is_overload(&self) -> bool {
        match self {
            Self::Unreachable { is_refused, .. } => *is_refused,
            Self::Problem(problem) => matches!(problem.status, 429 | 503 | 507),
            _ => false,
        }
    }

    /// Whether the server refuses the token: it was revoked, or lacks a scope. The same call may succeed with another token.
    pub fn is_access_refused(&self) -> bool {
        match self {
            Self::Foreign { status, .. } => matches!(status, 401 | 403),
            _ => matches!(self.problem_status(), Some(401 | 403)),
        }
    }

    /// The HTTP status of the server's problem, if any.
    pub fn problem_status(&self) -> Option<u16> {
        match self {
            Self::Problem(problem) => Some(problem.status),
            _ => None,
        }
    }

    pub(super) fn transport(server: &str, error: &reqwest::Error) -> Self {
        let server = server.to_owned();
        let cause = reason::innermost(error);
        if error.is_decode() {
            return Self::Body { server, reason: cause.to_string() };
        }
        let is_refused = cause
            .downcast_ref()
            .is_some_and(|cause: &io::Error| cause.kind() == io::ErrorKind::ConnectionRefused);
        Self::Unreachable { server, reason: reason::explain(error), is_refused }
    }
}

fn is_transient_status(status: u16) -> bool {
    status >= 500 || matches!(status, 408 | 425 | 429)
}

fn describe(problem: &Problem) -> String {
    // The detail repeats a single fault: omit it.
    let is_fault = problem.errors.iter().any(|fault| fault.to_string() == problem.detail);
    let is_title = problem.detail.is_empty() || is_fault;
    let mut text = one_line(if is_title { &problem.title } else { &problem.detail }).into_owned();
    for fault in &problem.errors {
        text.push_str("\n  ");
        text.push_str(&fault_line(fault));
    }
    text
}
