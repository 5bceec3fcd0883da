//! The log on stderr and, with the feature `otlp`, traces to an OpenTelemetry collector.

use std::io::IsTerminal;

use roost_terminal::log_writer;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;
use tracing_subscriber::{EnvFilter, Layer};

/// Variables with the address of a collector.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", "OTEL_EXPORTER_OTLP_ENDPOINT"];

/// Guard of the traces; dropping it sends those that wait.
#[must_use]
pub(crate) struct Telemetry {
    #[cfg(feature = "otlp")]
    _traces: Option<otlp::Traces>,
}

/// The format of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum LogFormat {
    /// Text lines.
    Text,
    /// One JSON object per line, for programs that collect logs.
    Json,
}

/// Starts the log and the traces. `default_filter` applies without ROOST_LOG; there are no traces without a service name.
pub(crate) fn start(
    default_filter: &str,
    format: LogFormat,
    service_name: Option<&'static str>,
) -> Telemetry {
    let filter = EnvFilter::try_from_env("ROOST_LOG").unwrap_or_else(|_| default_filter.into());
    let log = tracing_subscriber::fmt::layer();
    let log = match format {
        // JSON strings are escaped.
        LogFormat::Json => {
            log.json().flatten_event(true).with_writer(std::io::stderr).with_filter(filter).boxed()
        }
        // Lines show their target, which identifies the audit log.
        LogFormat::Text => {
            let has_colours = std::io::stderr().is_terminal();
            log.with_writer(log_writer).with_ansi(has_colours).with_filter(filter).boxed()
        }
    };
    let registry = tracing_subscriber::registry().with(log);
    let service_name = service_name
        .filter(|_| ENDPOINTS.iter().any(|name| std::env::var_os(name).is_some_and(|it| !it.is_empty())));
    #[cfg(not(feature = "otlp"))]
    {
        registry.init();
        if service_name.is_some() {
            tracing::warn!(
                "OTEL_EXPORTER_OTLP_ENDPOINT is set, but this build cannot send traces; build with the feature `otlp`"
            );
        }
        Telemetry {}
    }
    #[cfg(feature = "otlp")]
    {
        let traces = service_name.map(otlp::start).transpose();
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
    //! Requests to a server and attempts of a worker as spans, which a thread sends over HTTP in batches. The standard variables of
    //! OpenTelemetry configure it.

    use std::time::Duration;

    use opentelemetry::trace::TracerProvider;
    use opentelemetry_otlp::{ExporterBuildError, SpanExporter};
    use opentelemetry_sdk::Resource;
    use opentelemetry_sdk::trace::SdkTracerProvider;
    use tracing::Subscriber;
    use tracing_subscriber::registry::LookupSpan;
    use tracing_subscriber::{EnvFilter, Layer};

    /// Only the spans of the crates `roost*`: those of the HTTP client would trace the sending itself.
    const SPANS: &str = "off,roost=debug";

    /// Maximum time that the exit waits for a collector.
    const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(2);

    pub(super) struct Traces(SdkTracerProvider);

    impl Traces {
        /// The layer that turns spans into traces.
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
            if let Err(error) = self.0.shutdown_with_timeout(SHUTDOWN_TIMEOUT) {
                tracing::warn!(%error, "the last traces were not sent");
            }
        }
    }

    pub(super) fn start(service_name: &'static str) -> Result<Traces, ExporterBuildError> {
        roost_worker::client::prepare_tls();
        let exporter = SpanExporter::builder().with_http().build()?;
        let mut resource = Resource::builder();
        if std::env::var_os("OTEL_SERVICE_NAME").is_none() {
            resource = resource.with_service_name(service_name);
        }
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(resource.build())
            .build();
        Ok(Traces(provider))
    }
}
