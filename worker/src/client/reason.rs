//! Why a server cannot be reached, with advice: errors of TLS alone name neither the option nor the mistake.

use std::error::Error;
use std::io;

use rustls::CertificateError;

/// Advice for a certificate of an unknown authority.
const NAME_AUTHORITY: &str =
    "name the file with the certificate (PEM) of the server's authority with --ca FILE or ROOST_CA";

/// The innermost cause, with advice for errors of TLS.
pub(super) fn explain(error: &reqwest::Error) -> String {
    if error.is_timeout() {
        return "no answer in time".to_owned();
    }
    if let Some(advice) = chain(error).find_map(tls).map(of_tls) {
        return advice;
    }
    if chain(error).filter_map(<dyn Error>::downcast_ref).any(hyper::Error::is_parse) {
        return "the answer is not HTTP; if the port speaks TLS, write the address with https://".to_owned();
    }
    innermost(error).to_string()
}

/// Advice for an answer of another program, such as a port that needs TLS.
pub(super) fn explain_answer(server: &str, status: u16, body: &str) -> &'static str {
    let body = body.to_lowercase();
    let wants_tls = body.contains("https") || body.contains("ssl-enabled");
    if status == 400 && wants_tls && server.starts_with("http://") {
        "; write the address with https://"
    } else {
        ""
    }
}

/// reqwest wraps the cause several times over; only the innermost says something.
pub(super) fn innermost(error: &reqwest::Error) -> &(dyn Error + 'static) {
    chain(error).last().expect("a chain has a first link")
}

fn chain(error: &reqwest::Error) -> impl Iterator<Item = &(dyn Error + 'static)> {
    let first: &(dyn Error + 'static) = error;
    std::iter::successors(Some(first), |error: &&(dyn Error + 'static)| (*error).source())
}

/// The error of TLS in a link of the chain: an [`io::Error`] hides what it wraps, and may wrap another.
fn tls<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a rustls::Error> {
    let wrapped = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
    error.downcast_ref().or_else(|| tls(wrapped?))
}

fn of_tls(error: &rustls::Error) -> String {
    match error {
        rustls::Error::InvalidMessage(_) => {
            "the answer is not TLS; if the port speaks plain HTTP, write the address with http://".to_owned()
        }
        // A bad signature comes from an authority with the same name and another key, such as a recreated one.
        rustls::Error::InvalidCertificate(
            CertificateError::UnknownIssuer | CertificateError::BadSignature,
        ) => {
            format!("the server's certificate comes from an authority that is not trusted; {NAME_AUTHORITY}")
        }
        rustls::Error::InvalidCertificate(reason) => {
            format!("the server's certificate is refused: {reason}{}", of_certificate(reason))
        }
        other => other.to_string(),
    }
}

/// Advice for a refused certificate.
fn of_certificate(reason: &CertificateError) -> &'static str {
    match reason {
        CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
            "; write the address with a name that the certificate has"
        }
        // As `openssl req -x509` makes them.
        CertificateError::Other(other) if other.to_string().contains("CaUsedAsEndEntity") => {
            "; it is an authority's own certificate: give the server another one that is signed by it (CA:FALSE)"
        }
        _ => "",
    }
}
