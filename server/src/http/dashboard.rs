//! The dashboard: pages of plain HTML and ES modules, embedded in the binary; they read the API like any other client.
//!
//! Every page is the same shell; its module `server/dashboard/main.js` looks at the path. The policy lets a page load from this server alone, run no text
//! as code, and be framed by nobody.

use std::sync::LazyLock;

use axum::Router;
use axum::extract::Path;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};

use super::problem::{ApiError, Kind};
use super::session;
use super::tags::has_seen;
use crate::app::App;

/// Where pages are; all of them are the shell.
pub(super) const PAGES: &[&str] = &["/", "/sweeps/{id}", "/jobs/{id}", "/workers", "/compare", "/submit"];

/// The hash is that of nothing: plotly.js takes styles away by making their attribute empty.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; \
                      style-src-attr 'unsafe-hashes' 'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='; \
                      img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'none'";

/// A file of the dashboard.
struct Asset {
    name: &'static str,
    content_type: &'static str,
    /// Packed with gzip, which every browser reads.
    is_packed: bool,
    bytes: &'static [u8],
    tag: HeaderValue,
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
    assets.push(Asset { is_packed: true, ..Asset::new("plotly.min.js", plotly) });
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
        let tag = format!("\"{}\"", &blake3::hash(bytes).to_hex()[..32]);
        let tag = HeaderValue::try_from(tag).expect("hexadecimal digits");
        Self { name, content_type, is_packed: false, bytes, tag }
    }

    /// The file, or 304 to who has it. Browsers ask each time: a new server brings new files under the old names.
    fn answer(&self, headers: &HeaderMap) -> Response {
        let caching = [(header::ETAG, self.tag.clone()), (header::CACHE_CONTROL, fixed("no-cache"))];
        if has_seen(headers, &self.tag) {
            return (StatusCode::NOT_MODIFIED, caching).into_response();
        }
        let safety = [
            (header::CONTENT_TYPE, fixed(self.content_type)),
            (header::CONTENT_SECURITY_POLICY, fixed(POLICY)),
            (header::X_CONTENT_TYPE_OPTIONS, fixed("nosniff")),
            (header::REFERRER_POLICY, fixed("no-referrer")),
        ];
        let packing: &[(HeaderName, HeaderValue)] =
            if self.is_packed { &[(header::CONTENT_ENCODING, fixed("gzip"))] } else { &[] };
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
    let asset = asset.ok_or_else(|| ApiError::new(Kind::NotFound, "the dashboard has no such file"))?;
    Ok(asset.answer(&headers))
}
