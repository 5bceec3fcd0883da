//! The dashboard: HTML and ES modules embedded in the binary. They use the API like any other client.
//!
//! Every page is the same HTML file, whose module `server/dashboard/main.js` selects the content by path. The content security
//! policy lets a page load from this server only, evaluate no text as code, and be framed by no site.

use std::sync::LazyLock;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};

use super::etags::matches_etag;
use super::problem::{ApiError, ProblemKind};
use super::session;
use crate::state::App;

/// Routes of the pages.
pub(super) const PAGES: &[&str] = &["/", "/sweeps/{id}", "/jobs/{id}", "/workers", "/compare", "/submit"];

/// The hash is that of an empty style: plotly.js removes styles by setting empty attributes.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
                      style-src-attr 'unsafe-hashes' 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='; \
                      img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A file of the dashboard.
struct Asset {
    name: &'static str,
    content_type: &'static str,
    /// Compressed with gzip, which every browser supports.
    is_gzip: bool,
    bytes: &'static [u8],
    etag: HeaderValue,
}

/// Declares files of `server/dashboard/` by their path there.
macro_rules! assets {
    ($($name:literal),* $(,)?) => {
        vec![$(Asset::new($name, include_bytes!(concat!("../../dashboard/", $name)))),*]
    };
}

static SHELL: LazyLock<Asset> =
    LazyLock::new(|| Asset::new("page.html", include_bytes!("../../dashboard/page.html")));

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let mut assets = assets![
        "style.css",
        "mark.svg",
        "main.js",
        "document.js",
        "dom.js",
        "api.js",
        "format.js",
        "parts.js",
        "session.js",
        "measures.js",
        "outputs.js",
        "pages/sweeps.js",
        "pages/sweep.js",
        "pages/job.js",
        "pages/workers.js",
        "pages/compare.js",
        "pages/submit.js",
        "sections/curves.js",
        "sections/extend.js",
        "sections/head.js",
        "sections/series.js",
        "sections/tables.js",
        "plots/plot.js",
        "plots/response.js",
        "plots/map.js",
        "plots/effects.js",
        "plots/curves.js",
        "plots/parallel.js",
        "plots/surface.js",
        "plots/forms/forms.js",
        "plots/forms/lines.js",
        "plots/forms/drop.js",
        "plots/forms/bend.js",
        "plots/forms/slide.js",
        "plots/forms/compress.js",
        "playback/frames.js",
        "playback/unpack.js",
        "playback/scene.js",
        "playback/camera.js",
        "playback/player.js",
    ];
    let plotly = include_bytes!(concat!(env!("OUT_DIR"), "/plotly.min.js.gz"));
    assets.push(Asset { is_gzip: true, ..Asset::new("plotly.min.js", plotly) });
    assets
});

impl Asset {
    fn new(name: &'static str, bytes: &'static [u8]) -> Self {
        let content_type = match name.rsplit('.').next() {
            Some("html") => "text/html; charset=utf-8",
            Some("css") => "text/css; charset=utf-8",
            Some("svg") => "image/svg+xml",
            _ => "text/javascript; charset=utf-8",
        };
        let etag = format!("\"{}\"", &blake3::hash(bytes).to_hex()[..32]);
        let etag = HeaderValue::try_from(etag).expect("hexadecimal digits");
        Self { name, content_type, is_gzip: false, bytes, etag }
    }

    /// The file, or 304 if the browser has it. Browsers revalidate each time: a new server has new files under the same names.
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
    let pages = PAGES.iter().fold(Router::new(), |router, path| router.route(path, get(shell)));
    pages
        .route("/dashboard/session", post(session::begin).delete(session::end))
        .route("/dashboard/{*file}", get(file))
}

async fn shell(headers: HeaderMap) -> Response {
    SHELL.answer(&headers)
}

async fn file(Path(file): Path<String>, headers: HeaderMap) -> Result<Response, ApiError> {
    let asset = ASSETS.iter().find(|asset| asset.name == file);
    let asset = asset.ok_or_else(|| {
        ApiError::new(ProblemKind::NotFound, "the dashboard has no such file: / is its first page")
    })?;
    Ok(asset.answer(&headers))
}
