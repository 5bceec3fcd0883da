//! Error answers: one table of the kinds of problem, and the one place where errors become HTTP.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use roost_api::Fault;
use roost_api::problem::{MEDIA_TYPE, Problem};

use crate::queue::Refusal;
use crate::store::{Hindrance, StoreError};

/// Declares the kinds of problem: name in the `type` field, status, title.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident = $slug:literal, $status:ident, $title:literal;)*) => {
        /// A kind of problem.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum Kind { $($(#[$doc])* $name),* }

        impl Kind {
            /// Every kind; `api.md` lists them.
            pub(crate) const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The `type` field.
            pub(crate) fn uri(self) -> &'static str {
                match self { $(Self::$name => concat!("/problems/", $slug)),* }
            }

            /// The HTTP status.
            pub(crate) fn status(self) -> StatusCode {
                match self { $(Self::$name => StatusCode::$status),* }
            }

            /// The kind in words.
            pub(crate) fn title(self) -> &'static str {
                match self { $(Self::$name => $title),* }
            }
        }
    };
}

kinds! {
    NotFound = "not-found", NOT_FOUND, "There is no such thing here";
    MethodNotAllowed = "method-not-allowed", METHOD_NOT_ALLOWED, "The path does not know this method";
    InvalidPath = "invalid-path", BAD_REQUEST, "The path holds something unreadable";
    InvalidQuery = "invalid-query", BAD_REQUEST, "The query string is wrong";
    Syntax = "syntax", BAD_REQUEST, "The body is not JSON";
    UnreadableBody = "unreadable-body", BAD_REQUEST, "The body did not arrive whole";
    SlowBody = "slow-body", REQUEST_TIMEOUT, "The body came too slowly";
    InvalidKey = "invalid-idempotency-key", BAD_REQUEST, "The Idempotency-Key is unreadable";
    Unauthorized = "unauthorized", UNAUTHORIZED, "A token is needed";
    Forbidden = "forbidden", FORBIDDEN, "The token does not allow this";
    CrossSite = "cross-site", FORBIDDEN, "A page of another site asked for this";
    WrongHost = "wrong-host", MISDIRECTED_REQUEST, "Without tokens the server answers to loopback names only";
    NotJson = "not-json", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as JSON";
    NotStl = "not-stl", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as STL";
    NotFrames = "not-frames", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as frames";
    NoSuchRange = "no-such-range", RANGE_NOT_SATISFIABLE, "There are no such bytes";
    TooLarge = "too-large", PAYLOAD_TOO_LARGE, "The body is over the size limit";
    InvalidDocument = "invalid-document", UNPROCESSABLE_ENTITY, "The document has faults";
    InvalidMesh = "invalid-mesh", UNPROCESSABLE_ENTITY, "The file is no sound mesh";
    KeyReused = "idempotency-key-reused", UNPROCESSABLE_ENTITY, "The Idempotency-Key stands for another request";
    TooManyRequests = "too-many-requests", TOO_MANY_REQUESTS, "Asked too often";
    WrongResult = "wrong-result", UNPROCESSABLE_ENTITY, "The delivery does not fit the job";
    StaleAttempt = "stale-attempt", CONFLICT, "The attempt may not write any more";
    WrongState = "wrong-state", CONFLICT, "The job is in another state";
    WorkerRefused = "worker-refused", CONFLICT, "The worker does not go with this server";
    ClockJumped = "clock-jumped", CONFLICT, "The server's clock has jumped";
    Unavailable = "unavailable", SERVICE_UNAVAILABLE, "The server cannot answer now";
    StorageFull = "storage-full", INSUFFICIENT_STORAGE, "The server's disk is full";
    Internal = "internal", INTERNAL_SERVER_ERROR, "The server made a mistake";
}

/// An error answer on its way.
#[derive(Debug)]
pub(crate) struct ApiError {
    kind: Kind,
    detail: String,
    faults: Vec<Fault>,
}

impl ApiError {
    /// A problem of that kind; the detail says what to do about it.
    pub(crate) fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self { kind, detail: detail.into(), faults: Vec::new() }
    }

    /// A document with faults.
    pub(crate) fn faults(faults: Vec<Fault>) -> Self {
        Self::at(Kind::InvalidDocument, faults)
    }

    /// A problem of that kind at some places of the document.
    pub(crate) fn at(kind: Kind, faults: Vec<Fault>) -> Self {
        let detail = match faults.as_slice() {
            [only] => only.to_string(),
            all => format!("{} faults; each is in `errors` with its JSON pointer", all.len()),
        };
        Self { kind, detail, faults }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let status = self.kind.status();
        let problem = Problem {
            kind: self.kind.uri().to_owned(),
            title: self.kind.title().to_owned(),
            status: status.as_u16(),
            detail: self.detail,
            errors: self.faults,
        };
        let mut response = (status, axum::Json(problem)).into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
        response.extensions_mut().insert(self.kind);
        response
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        tracing::error!(error = error.as_dyn(), "the store failed");
        match (error.hindrance(), &error) {
            (Some(Hindrance::Busy), _) => {
                Self::new(Kind::Unavailable, "the database is held by another program; try again later")
            }
            (Some(Hindrance::Full), _) => Self::new(
                Kind::StorageFull,
                "the disk of the server's data directory is full: nothing changed",
            ),
            (None, error) if error.is_stopping() => {
                Self::new(Kind::Unavailable, "the server is stopping; try again later")
            }
            _ => Self::new(
                Kind::Internal,
                "the database did not do what it should; the server's log says more",
            ),
        }
    }
}

impl From<Refusal> for ApiError {
    fn from(refusal: Refusal) -> Self {
        let kind = match refusal {
            Refusal::NoJob | Refusal::NoSweep | Refusal::NoAttempt | Refusal::NoWorker => Kind::NotFound,
            Refusal::Superseded { .. }
            | Refusal::JobEnded { .. }
            | Refusal::AttemptEnded { .. }
            | Refusal::OtherWorker => Kind::StaleAttempt,
            Refusal::OtherScenario | Refusal::NotReportable { .. } => Kind::WrongResult,
            Refusal::OtherRegistration => Kind::WorkerRefused,
            Refusal::OtherSolver(faults) => return Self::at(Kind::WrongResult, faults),
            Refusal::NotRetryable { .. } | Refusal::OtherClass { .. } => Kind::WrongState,
        };
        Self::new(kind, refusal.to_string())
    }
}
