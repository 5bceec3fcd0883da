//! The dashboard: HTML and ES modules embedded in the binary. They use the API like any other client.
//!
//! Every page is the same HTML file, whose module `server/dashboard/main.js` selects the content by path. The
//! content security policy lets a page load from this server only, evaluate no text as code, and be framed by
//! no site.

use std::collections::HashMap;
use std::sync::LazyLock;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

use super::etags::matches_etag;
use super::problem::{ApiError, ProblemKind};
use super::session;
use crate::state::App;

/// Routes of the pages.
pub(super) const PAGES: &[&str] = &[
    "/",
    "/sweeps/{id}",
    "/studies",
    "/studies/{id}",
    "/jobs/{id}",
    "/workers",
    "/projects",
    "/compare",
    "/submit",
];

/// The hash is that of an empty style: plotly.js removes styles by setting empty attributes.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
                      style-src-attr 'unsafe-hashes' 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='; \
                      img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A file of the dashboard.
struct Asset {
    content_type: &'static str,
    /// Compressed with gzip, which every browser supports.
    is_gzip: bool,
    bytes: &'static [u8],
    etag: HeaderValue,
}

/// Name and content of every file of `server/dashboard/`; the build script writes the list.
const FILES: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/dashboard.rs"));

/// The HTML file of all pages.
const PAGE: &str = "page.html";

/// Every file by its name.
static ASSETS: LazyLock<HashMap<&str, Asset>> = LazyLock::new(|| {
    let plotly = include_bytes!(concat!(env!("OUT_DIR"), "/plotly.min.js.gz"));
    let plotly = ("plotly.min.js", Asset { is_gzip: true, ..Asset::new("plotly.min.js", plotly) });
    let files = FILES.iter().map(|(name, bytes)| (*name, Asset::new(name, bytes)));
    files.chain([plotly]).collect()
});

impl Asset {
    fn new(name: &str, bytes: &'static [u8]) -> Self {
        let content_type = match name.rsplit('.').next() {
            Some("html") => "text/html; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "text/javascript; charset=utf-8",
        };
        let etag = format!("\"{}\"", &blake3::hash(bytes).to_hex()[..32]);
        let etag = HeaderValue::try_from(etag).expect("hexadecimal digits");
        Self { content_type, is_gzip: false, bytes, etag }
    }

    /// The file, or 304 if the browser has it. Browsers revalidate each time: a new server has new files
    /// under the same names.
    fn answer(&self, headers: &HeaderMap) -> Response {
        let caching = [(header::ETAG, self.etag.clone()), (header::CACHE_CONTROL, fixed("no-cache"))];
        if matches_etag(headers, &self.etag) {
            return (StatusCode::NOT_MODIFIED, caching).into_response();
        }
        let safety = [
            (header::CONTENT_TYPE, fixed(self.content_type)),
            (header::CONTENT_SECURITY_POLICY, fixed(POLICY)),
            (header::X_CONTENT_TYPE_OPTIONS, fixed("nosniff")),
            (header::REFERRER_POLICY, fixed("no-referrer")),
        ];
        let packing: &[(HeaderName, HeaderValue)] =
            if self.is_gzip { &[(header::CONTENT_ENCODING, fixed("gzip"))] } else { &[] };
        let mut response = (caching, safety, self.bytes).into_response();
        response.headers_mut().extend(packing.iter().cloned());
        response
    }
}

const fn fixed(value: &'static str) -> HeaderValue {
    HeaderValue::from_static(value)
}

/// Routes of pages and files.
pub(super) fn router() -> Router<App> {
    let pages = PAGES.iter().fold(Router::new(), |router, path| router.route(path, get(page)));
    pages
        .route("/dashboard/session", get(session::show).post(session::begin).delete(session::end))
        .route("/dashboard/{*file}", get(file))
}

async fn page(headers: HeaderMap) -> Response {
    ASSETS[PAGE].answer(&headers)
}

async fn file(Path(name): Path<String>, headers: HeaderMap) -> Result<Response, ApiError> {
    let asset = ASSETS.get(name.as_str()).filter(|_| name != PAGE);
    let asset = asset.ok_or_else(|| {
        ApiError::new(ProblemKind::NotFound, format!("the dashboard has no file {name}: its first page is /"))
    })?;
    Ok(asset.answer(&headers))
}
