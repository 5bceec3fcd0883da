//! Error answers: the table of problem kinds, and the conversion of errors to HTTP.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use roost_api::Fault;
use roost_api::problem::{MEDIA_TYPE, Problem};

use crate::queue::Refusal;
use crate::state::{AccessError, MeshCacheError};
use crate::store::{StoreError, Unavailable};

/// Declares the problem kinds: name in the `type` field, status, title.
macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident = $slug:literal, $status:ident, $title:literal;)*) => {
        /// The kind of a problem.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum ProblemKind { $($(#[$doc])* $name),* }

        impl ProblemKind {
            /// Every kind, as `api.md` lists them.
            pub(crate) const ALL: &'static [Self] = &[$(Self::$name),*];

            /// The `type` field.
            pub(crate) fn uri(self) -> &'static str {
                match self { $(Self::$name => concat!("/problems/", $slug)),* }
            }

            /// The HTTP status.
            pub(crate) fn status(self) -> StatusCode {
                match self { $(Self::$name => StatusCode::$status),* }
            }

            /// The `title` field.
            pub(crate) fn title(self) -> &'static str {
                match self { $(Self::$name => $title),* }
            }
        }
    };
}

kinds! {
    NotFound = "not-found", NOT_FOUND, "Not found";
    MethodNotAllowed = "method-not-allowed", METHOD_NOT_ALLOWED, "The path does not support this method";
    InvalidPath = "invalid-path", BAD_REQUEST, "A part of the path is invalid";
    InvalidQuery = "invalid-query", BAD_REQUEST, "The query string is invalid";
    Syntax = "syntax", BAD_REQUEST, "The body is not JSON";
    UnreadableBody = "unreadable-body", BAD_REQUEST, "The body is incomplete";
    SlowBody = "slow-body", REQUEST_TIMEOUT, "The body arrived too slowly";
    InvalidKey = "invalid-idempotency-key", BAD_REQUEST, "The Idempotency-Key is invalid";
    Unauthorized = "unauthorized", UNAUTHORIZED, "A valid token is required";
    Forbidden = "forbidden", FORBIDDEN, "The token does not allow this";
    CrossSite = "cross-site", FORBIDDEN, "The request comes from a page of another site";
    WrongHost = "wrong-host", MISDIRECTED_REQUEST, "A server without tokens accepts loopback names only";
    NotJson = "not-json", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as JSON";
    NotStl = "not-stl", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as STL";
    NotFrames = "not-frames", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as frames";
    NotCheckpoint = "not-checkpoint", UNSUPPORTED_MEDIA_TYPE, "The body is not declared as a checkpoint";
    NoSuchRange = "no-such-range", RANGE_NOT_SATISFIABLE, "The range is outside the content";
    TooLarge = "too-large", PAYLOAD_TOO_LARGE, "The body exceeds the size limit";
    InvalidDocument = "invalid-document", UNPROCESSABLE_ENTITY, "The document has faults";
    InvalidMesh = "invalid-mesh", UNPROCESSABLE_ENTITY, "The file is not a valid mesh";
    KeyReused = "idempotency-key-reused", UNPROCESSABLE_ENTITY, "The Idempotency-Key belongs to another request";
    TooManyRequests = "too-many-requests", TOO_MANY_REQUESTS, "Too many requests";
    WrongResult = "wrong-result", UNPROCESSABLE_ENTITY, "The delivery does not match the job";
    StaleAttempt = "stale-attempt", CONFLICT, "The attempt has ended or was superseded";
    WrongState = "wrong-state", CONFLICT, "The state does not allow this";
    WorkerRefused = "worker-refused", CONFLICT, "The worker is incompatible with this server";
    ClockJumped = "clock-jumped", CONFLICT, "The server's clock has jumped";
    Unavailable = "unavailable", SERVICE_UNAVAILABLE, "The server is temporarily unavailable";
    StorageFull = "storage-full", INSUFFICIENT_STORAGE, "The server's disk is full";
    Internal = "internal", INTERNAL_SERVER_ERROR, "Internal server error";
}

/// An error answer.
#[derive(Debug)]
pub(crate) struct ApiError {
    kind: ProblemKind,
    detail: String,
    faults: Vec<Fault>,
}

impl ApiError {
    /// A problem. The detail states what is wrong, what is allowed and what to do.
    pub(crate) fn new(kind: ProblemKind, detail: impl Into<String>) -> Self {
        Self { kind, detail: detail.into(), faults: Vec::new() }
    }

    /// A document with faults.
    pub(crate) fn faults(faults: Vec<Fault>) -> Self {
        Self::at(ProblemKind::InvalidDocument, faults)
    }

    /// A problem of some fields of a document.
    pub(crate) fn at(kind: ProblemKind, faults: Vec<Fault>) -> Self {
        let detail = match faults.as_slice() {
            [only] => only.to_string(),
            all => format!("{} faults: `errors` lists each with its JSON pointer", all.len()),
        };
        Self { kind, detail, faults }
    }

    /// Whether a document is not JSON or has faults.
    pub(crate) fn is_of_document(&self) -> bool {
        matches!(self.kind, ProblemKind::Syntax | ProblemKind::InvalidDocument)
    }

    /// Whether the server failed.
    pub(crate) fn is_of_server(&self) -> bool {
        self.kind.status().is_server_error()
    }

    /// The problem document.
    pub(crate) fn into_problem(self) -> Problem {
        Problem {
            kind: self.kind.uri().to_owned(),
            title: self.kind.title().to_owned(),
            status: self.kind.status().as_u16(),
            detail: self.detail,
            errors: self.faults,
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let kind = self.kind;
        let mut response = (kind.status(), axum::Json(self.into_problem())).into_response();
        response.headers_mut().insert(header::CONTENT_TYPE, HeaderValue::from_static(MEDIA_TYPE));
        response.extensions_mut().insert(kind);
        response
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        tracing::error!(error = error.as_dyn(), "the store failed");
        match (error.unavailable(), &error) {
            (Some(reason @ (Unavailable::Full | Unavailable::FullPostgres)), _) => {
                Self::new(ProblemKind::StorageFull, reason.sentence())
            }
            (Some(reason), _) => Self::new(ProblemKind::Unavailable, reason.sentence()),
            (None, StoreError::Object(_)) => Self::new(
                ProblemKind::Unavailable,
                "the server could not store or read an object: try again later; the server's log states the reason",
            ),
            (None, error) if error.is_stopping() => {
                Self::new(ProblemKind::Unavailable, "the server is stopping: try again later")
            }
            _ => Self::new(
                ProblemKind::Internal,
                "the database query failed: the server's log states the reason",
            ),
        }
    }
}

impl From<AccessError> for ApiError {
    fn from(error: AccessError) -> Self {
        let kind = match error {
            AccessError::NoToken | AccessError::InvalidToken | AccessError::ExpiredToken { .. } => {
                ProblemKind::Unauthorized
            }
            AccessError::MissingScope { .. } => ProblemKind::Forbidden,
            AccessError::TooManyRequests { .. } => ProblemKind::TooManyRequests,
        };
        Self::new(kind, error.to_string())
    }
}

impl From<MeshCacheError> for ApiError {
    fn from(error: MeshCacheError) -> Self {
        match error {
            MeshCacheError::TooManyTriangles(fault) => Self::faults(vec![fault]),
            MeshCacheError::Store(error) => error.into(),
            MeshCacheError::Damaged(_) | MeshCacheError::Reader(_) => {
                Self::new(ProblemKind::Internal, error.to_string())
            }
        }
    }
}

impl From<Refusal> for ApiError {
    fn from(refusal: Refusal) -> Self {
        let kind = match refusal {
            Refusal::NoJob | Refusal::NoSweep | Refusal::NoStudy | Refusal::NoAttempt | Refusal::NoWorker => {
                ProblemKind::NotFound
            }
            Refusal::Superseded { .. }
            | Refusal::JobEnded { .. }
            | Refusal::AttemptEnded { .. }
            | Refusal::OtherWorker => ProblemKind::StaleAttempt,
            Refusal::OtherScenario | Refusal::NotReportable { .. } => ProblemKind::WrongResult,
            Refusal::OtherRegistration => ProblemKind::WorkerRefused,
            Refusal::OtherSolver(faults) => return Self::at(ProblemKind::WrongResult, faults),
            Refusal::NotRetryable { .. } | Refusal::OtherClass { .. } => ProblemKind::WrongState,
        };
        Self::new(kind, refusal.to_string())
    }
}
