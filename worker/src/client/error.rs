//! Everything that can go wrong between a client and the server, said so that a person can act on it.

use std::io;

use roost_api::Fault;
use roost_api::printable::one_line;
use roost_api::problem::Problem;

use super::reason;

/// Why a call did not give what was asked for.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address is none.
    #[error("`{0}` is no server address: write it like http://127.0.0.1:7373")]
    Address(String),
    /// The token cannot be sent.
    #[error("the access token has characters that no token has")]
    Token,
    /// The file of authorities cannot be used; says why.
    #[error("the file of certificates to trust (--ca or ROOST_CA) cannot be used: {0}")]
    Authorities(String),
    /// The system has no authorities to check the server's certificate by.
    #[error(
        "cannot check the certificate of {server}: {reason}. Install the system's certificates (Debian: ca-certificates), \
         or name the file with the certificate of the server's authority with --ca FILE or ROOST_CA"
    )]
    NoAuthorities {
        /// Address of the server.
        server: String,
        /// What was looked for in vain.
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
    /// A file that was to be sent cannot be read, or one that came cannot be written.
    #[error("cannot use {}: {reason}", path.display())]
    File {
        /// The file.
        path: std::path::PathBuf,
        /// Why.
        reason: String,
    },
    /// Nothing answered, or not in time. Trying again may help.
    #[error("cannot reach {server}: {}", one_line(reason))]
    Unreachable {
        /// Address of the server.
        server: String,
        /// The innermost cause, such as `Connection refused`, and what to do about it where that is known.
        reason: String,
        /// Whether it was that: nobody listens there.
        is_refused: bool,
    },
    /// The server answered with a problem.
    #[error("{}", describe(.0))]
    Problem(Box<Problem>),
    /// An error answer that is no problem document: something else answers there.
    #[error("{server} answered {status} without saying why: {}{}", one_line(body), reason::of_answer(server, *status, body))]
    Foreign {
        /// Address of the server.
        server: String,
        /// HTTP status.
        status: u16,
        /// Start of the body.
        body: String,
    },
    /// A success whose body is not what the API promises.
    #[error("{server} sent an answer that this version does not understand: {}", one_line(reason))]
    Body {
        /// Address of the server.
        server: String,
        /// What was wrong with it.
        reason: String,
    },
}

impl ClientError {
    /// Whether the same call may well succeed later: the server is away, overloaded or restarting.
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

    /// Whether the server will not have who asks, whatever is asked: a token that has been revoked, or lacks a scope. What was
    /// refused so may be taken from the next start, with another token.
    pub fn is_about_access(&self) -> bool {
        match self {
            Self::Foreign { status, .. } => matches!(status, 401 | 403),
            _ => matches!(self.problem_status(), Some(401 | 403)),
        }
    }

    /// The HTTP status of the server's problem, if there was one.
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
        Self::Unreachable { server, reason: reason::of(error), is_refused }
    }
}

fn is_transient_status(status: u16) -> bool {
    status >= 500 || matches!(status, 408 | 425 | 429)
}

fn describe(problem: &Problem) -> String {
    // The detail of a single fault is that fault: it would be there twice.
    let says_it_all = problem.errors.iter().any(|fault| fault.to_string() == problem.detail);
    let is_title = problem.detail.is_empty() || says_it_all;
    let mut text = one_line(if is_title { &problem.title } else { &problem.detail }).into_owned();
    for fault in &problem.errors {
        text.push_str("\n  ");
        text.push_str(&fault_line(fault));
    }
    text
}

/// A fault for people, in one line: where it is, what, and what would be allowed. An empty pointer is the document itself.
pub fn fault_line(fault: &Fault) -> String {
    let text = if fault.pointer.is_empty() { format!("the document{fault}") } else { fault.to_string() };
    one_line(&text).into_owned()
}
