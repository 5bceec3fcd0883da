//! Why a sign-in failed: a sentence for the user, and what to do.

use std::sync::Arc;

use super::Who;
use crate::store::StoreError;

/// Why a sign-in failed.
#[derive(Clone, Debug, thiserror::Error)]
pub(crate) enum SignInError {
    /// The server has no provider.
    #[error("this server has no identity provider")]
    NoProvider,
    /// A page of another site has sent the browser here.
    #[error("a page of another site began this sign-in")]
    Foreign,
    /// The cookie is missing, too old, or of another attempt.
    #[error("this sign-in began in another browser, or more than 10 minutes ago")]
    NoAttempt,
    /// The user or the provider said no.
    #[error("the sign-in was cancelled at the provider, or the provider refused it")]
    Cancelled,
    /// The provider reports another error.
    #[error("the provider answers {}", code_in_page(error))]
    Refused {
        /// Its code. The page has it only if it is one.
        error: String,
        /// Its explanation, for the log.
        description: Option<String>,
    },
    /// Too many codes at once.
    #[error("too many users sign in at the same time")]
    Busy,
    /// The provider does not answer.
    #[error("the provider {host} does not answer")]
    Away {
        /// Its host.
        host: String,
        /// The cause.
        cause: String,
    },
    /// The connection to the provider is not trustworthy.
    #[error("the certificate of the provider {host} is not trusted")]
    Certificate {
        /// Its host.
        host: String,
        /// The cause.
        cause: String,
    },
    /// The answer of the provider cannot be used.
    #[error("the answer of the provider is not usable: {0}")]
    Unusable(String),
    /// It names itself by another issuer.
    #[error("the answer of the provider is not usable: it has another issuer than --oidc-issuer")]
    OtherIssuer(String),
    /// One of its addresses could be read by others.
    #[error(
        "the answer of the provider is not usable: one of its addresses is neither https nor of this machine"
    )]
    UnsafeAddress(String),
    /// The provider does not accept the id and secret of this server.
    #[error("the provider does not accept this server as its client")]
    Client(String),
    /// The code was used before or has expired.
    #[error("the code of this sign-in was used before, or has expired")]
    Code(String),
    /// The ID token is not for this sign-in.
    #[error("the ID token of the provider is not valid: {0}")]
    Token(String),
    /// The ID token is from another time.
    #[error("the ID token of the provider is not valid at this time: it {0}")]
    Clock(&'static str),
    /// No rule fits.
    #[error("no rule of this server admits you. {}", groups_seen(groups))]
    NoRule {
        /// The user.
        who: Who,
        /// The groups that the provider named.
        groups: Vec<String>,
    },
    /// A rule names a project that does not exist.
    #[error("the project {project} does not exist on this server")]
    NoProject {
        /// The user.
        who: Who,
        /// Its name.
        project: String,
    },
    /// The database cannot be used.
    #[error("the server cannot store the session")]
    Store(Arc<StoreError>),
}

impl From<StoreError> for SignInError {
    fn from(error: StoreError) -> Self {
        Self::Store(Arc::new(error))
    }
}

/// Maximum length of a text of the provider that a page repeats, in characters.
const MAX_SHOWN: usize = 60;

/// An error code of the provider (RFC 6749, section 4.1.2.1), or what takes its place if it is free text.
fn code_in_page(code: &str) -> &str {
    let is_code = code.len() <= MAX_SHOWN && code.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if is_code { code } else { "an unknown error" }
}

/// Groups that an error names at most.
const MAX_GROUPS: usize = 20;

fn groups_seen(groups: &[String]) -> String {
    if groups.is_empty() {
        return "The provider named no group of yours".to_owned();
    }
    let more = if groups.len() > MAX_GROUPS { " and others" } else { "" };
    let short = |group: &String| group.chars().take(MAX_SHOWN).collect::<String>();
    let named: Vec<_> = groups.iter().take(MAX_GROUPS).map(short).collect();
    format!("The provider named these groups of yours: {}{more}", named.join(", "))
}

impl SignInError {
    /// The next step of the user.
    pub(crate) fn advice(&self) -> &'static str {
        match self {
            Self::NoProvider => "Sign in with a token, on the first page.",
            Self::NoAttempt => {
                "Sign in again, at the address that the operator has told you, and allow cookies of this site."
            }
            Self::Foreign => "Sign in on the first page of this server.",
            Self::Cancelled | Self::Code(_) => "Sign in again.",
            Self::Busy => "Wait a few seconds, and sign in again.",
            Self::Away { .. } => "Try again later. Tokens still work.",
            Self::Certificate { .. }
            | Self::Unusable(_)
            | Self::OtherIssuer(_)
            | Self::UnsafeAddress(_)
            | Self::Refused { .. }
            | Self::Token(_) => "Ask the operator of this server: its log has the reason. Tokens still work.",
            Self::Client(_) => {
                "Ask the operator of this server to check --oidc-client-id and --oidc-client-secret-file. Tokens still work."
            }
            Self::Clock(_) => {
                "Ask the operator of this server to compare its clock with the provider's. Tokens still work."
            }
            Self::NoRule { .. } => "Ask the operator of this server for a rule with --oidc-allow.",
            Self::NoProject { .. } => {
                "Ask the operator of this server to create it with `roost project create`."
            }
            Self::Store(_) => "Try again later: the server's log has the reason.",
        }
    }

    /// The status of the answer.
    pub(crate) fn status(&self) -> u16 {
        match self {
            Self::NoProvider => 404,
            Self::NoAttempt | Self::Code(_) => 400,
            Self::Foreign | Self::Cancelled | Self::NoRule { .. } => 403,
            Self::Busy => 429,
            Self::Away { .. } | Self::Store(_) => 503,
            Self::Certificate { .. }
            | Self::Unusable(_)
            | Self::OtherIssuer(_)
            | Self::UnsafeAddress(_)
            | Self::Refused { .. }
            | Self::Client(_)
            | Self::Token(_) => 502,
            Self::Clock(_) => 502,
            Self::NoProject { .. } => 500,
        }
    }

    /// The user, if the provider has named one.
    pub(crate) fn who(&self) -> Option<&Who> {
        match self {
            Self::NoRule { who, .. } | Self::NoProject { who, .. } => Some(who),
            _ => None,
        }
    }

    /// Whether the attempt is over. Otherwise its page may be loaded again, as after an answer that somebody has invented.
    pub(crate) fn ends_attempt(&self) -> bool {
        let may_repeat = matches!(
            self,
            Self::NoProvider
                | Self::Foreign
                | Self::NoAttempt
                | Self::Busy
                | Self::Away { .. }
                | Self::Certificate { .. }
                | Self::Store(_)
        );
        !may_repeat
    }

    /// The part of the reason that only the log has.
    pub(crate) fn cause(&self) -> Option<String> {
        match self {
            Self::Away { cause, .. }
            | Self::Certificate { cause, .. }
            | Self::Client(cause)
            | Self::OtherIssuer(cause)
            | Self::UnsafeAddress(cause)
            | Self::Code(cause) => Some(cause.clone()),
            Self::Refused { error, description } => {
                Some(format!("{error}: {}", description.as_deref().unwrap_or("no description")))
            }
            Self::Store(error) => Some(error.to_string()),
            _ => None,
        }
    }
}
