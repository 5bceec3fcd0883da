//! What a process tells of itself: a log on stderr and, built with the feature `otlp`, traces to a collector of OpenTelemetry.

use std::io::IsTerminal;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

use crate::ui;

/// Where a collector listens, for all that is told or for traces alone.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

/// Keeps traces going; those that wait are sent when it goes.
#[must_use]
pub(crate) struct Telemetry {
    #[cfg(feature = "otlp")]
    _traces: Option<otlp::Traces>,
}

/// The form of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum LogFormat {
    /// Lines for people.
    Text,
    /// A JSON object a line, for programs that collect logs.
    Json,
}

/// Starts to tell; `level` is what the log holds unless ROOST_LOG says otherwise. A role that runs for long has a name, under which
/// it is traced.
pub(crate) fn start(level: &str, format: LogFormat, role: Option<&'static str>) -> Telemetry {
    let filter = EnvFilter::try_from_env("ROOST_LOG").unwrap_or_else(|_| level.into());
    let log = tracing_subscriber::fmt::layer();
    let log = match format {
        // JSON escapes by itself.
        LogFormat::Json => {
            log.json().flatten_event(true).with_writer(std::io::stderr).with_filter(filter).boxed()
        }
        // The target tells lines of the audit log from others.
        LogFormat::Text => {
            let has_colours = std::io::stderr().is_terminal();
            log.with_writer(ui::log::log).with_ansi(has_colours).with_filter(filter).boxed()
        }
    };
    let registry = tracing_subscriber::registry().with(log);
    let role =
        role.filter(|_| ENDPOINTS.iter().any(|name| std::env::var_os(name).is_some_and(|it| !it.is_empty())));
    #[cfg(not(feature = "otlp"))]
    {
        registry.init();
        if role.is_some() {
            tracing::warn!(
                "OTEL_EXPORTER_OTLP_ENDPOINT: no traces are sent by a build without the feature `otlp`"
            );
        }
        Telemetry {}
    }
    #[cfg(feature = "otlp")]
    {
        let traces = role.map(otlp::start).transpose();
        let layer = traces.as_ref().ok().and_then(Option::as_ref).map(otlp::Traces::layer);
        registry.with(layer).init();
        let traces = traces.unwrap_or_else(|error| {
            tracing::error!(%error, "no traces are sent");
            None
        });
        Telemetry { _traces: traces }
    }
}

#[cfg(feature = "otlp")]
mod otlp {
    //! Requests to a server and the attempts of a worker as spans, sent over HTTP in groups by a thread of their own. The standard
    //! variables rule it.

    use std::time::Duration;

    use opentelemetry::trace::TracerProvider;
    use opentelemetry_otlp::{ExporterBuildError, SpanExporter};
    use opentelemetry_sdk::Resource;
    use opentelemetry_sdk::trace::SdkTracerProvider;
    use tracing::Subscriber;
    use tracing_subscriber::registry::LookupSpan;
    use tracing_subscriber::{EnvFilter, Layer};

    /// Our own spans (`roost` and what begins so), never those of what sends them.
    const SPANS: &str = "off,roost=debug";

    /// How long the end of a process waits for a collector.
    const LAST_WORD: Duration = Duration::from_secs(2);

    pub(super) struct Traces(SdkTracerProvider);

    impl Traces {
        /// Turns spans into traces.
        pub(super) fn layer<S>(&self) -> impl Layer<S> + use<S>
        where
            S: Subscriber + for<'span> LookupSpan<'span>,
        {
            let tracer = self.0.tracer("roost");
            tracing_opentelemetry::layer()
                .with_tracer(tracer)
                .with_location(false)
                .with_threads(false)
                .with_filter(EnvFilter::new(SPANS))
        }
    }

    impl Drop for Traces {
        fn drop(&mut self) {
            if let Err(error) = self.0.shutdown_with_timeout(LAST_WORD) {
                tracing::warn!(%error, "the last traces were not sent");
            }
        }
    }

    pub(super) fn start(role: &'static str) -> Result<Traces, ExporterBuildError> {
        roost_worker::client::prepare_tls();
        let exporter = SpanExporter::builder().with_http().build()?;
        let mut resource = Resource::builder();
        if std::env::var_os("OTEL_SERVICE_NAME").is_none() {
            resource = resource.with_service_name(role);
        }
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource.build())
            .build();
        Ok(Traces(provider))
    }
}
