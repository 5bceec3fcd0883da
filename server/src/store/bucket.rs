//! Objects in a bucket of S3, or of a compatible service, in place of the folder.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use object_store::ObjectStore;

use super::StoreError;

/// Bucket and prefix of the objects of one server. No other server may use the same prefix: each removes objects that it does not know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bucket {
    name: String,
    prefix: String,
}

/// The reason why an address is not a usable bucket.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BucketError {
    /// It is not the address of a bucket.
    #[error("give a bucket as s3://BUCKET or s3://BUCKET/PREFIX")]
    NotS3,
    /// This build has no support for buckets.
    #[error("buckets need a build with the feature `s3`: cargo build --release --features s3")]
    NotBuilt,
}

/// From `s3://BUCKET` or `s3://BUCKET/PREFIX`.
impl FromStr for Bucket {
    type Err = BucketError;

    fn from_str(text: &str) -> Result<Self, BucketError> {
        let (name, prefix) = match text.strip_prefix("s3://").ok_or(BucketError::NotS3)?.split_once('/') {
            Some((name, prefix)) => (name, prefix.trim_matches('/')),
            None => (text.trim_start_matches("s3://"), ""),
        };
        let is_plain =
            |text: &str| text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._".contains(&byte));
        if name.is_empty() || !is_plain(name) || !prefix.split('/').all(is_plain) || prefix.contains("//") {
            return Err(BucketError::NotS3);
        }
        if !cfg!(feature = "s3") {
            return Err(BucketError::NotBuilt);
        }
        Ok(Self { name: name.to_owned(), prefix: prefix.to_owned() })
    }
}

impl fmt::Display for Bucket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let slash = if self.prefix.is_empty() { "" } else { "/" };
        write!(f, "s3://{}{slash}{}", self.name, self.prefix)
    }
}

impl Bucket {
    /// Opens it with credentials, region and endpoint from the environment.
    #[cfg(feature = "s3")]
    pub(super) fn open(&self) -> Result<Arc<dyn ObjectStore>, StoreError> {
        use std::time::Duration;

        use object_store::aws::AmazonS3Builder;
        use object_store::prefix::PrefixStore;
        use object_store::{BackoffConfig, RetryConfig};

        // The default gives up after two seconds without an answer. A client of the server waits longer.
        let retry = RetryConfig {
            backoff: BackoffConfig { max_backoff: Duration::from_secs(3), ..BackoffConfig::default() },
            max_retries: 1000,
            retry_timeout: Duration::from_secs(20),
        };

        // The TLS provider is chosen once per process: the error of a second choice does no harm.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let bucket = AmazonS3Builder::from_env().with_bucket_name(&self.name).with_retry(retry).build();
        let bucket = bucket.map_err(|source| self.unusable(source))?;
        Ok(Arc::new(PrefixStore::new(bucket, self.prefix.as_str())))
    }

    /// This build has no support for buckets.
    #[cfg(not(feature = "s3"))]
    pub(super) fn open(&self) -> Result<Arc<dyn ObjectStore>, StoreError> {
        Err(self.unusable(BucketError::NotBuilt))
    }

    pub(super) fn unusable(&self, reason: impl fmt::Display) -> StoreError {
        StoreError::Bucket { bucket: self.to_string(), message: reason.to_string() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bucket_is_named_by_its_address() {
        for (text, shown) in [
            ("s3://roost", "s3://roost"),
            ("s3://roost/", "s3://roost"),
            ("s3://roost-1.eu/line/north/", "s3://roost-1.eu/line/north"),
        ] {
            let read: Result<Bucket, _> = text.parse();
            let expected =
                if cfg!(feature = "s3") { Ok(shown.to_owned()) } else { Err(BucketError::NotBuilt) };
            assert_eq!(read.map(|bucket| bucket.to_string()), expected, "{text}");
        }
        for wrong in [
            "",
            "roost",
            "s3://",
            "s3:///prefix",
            "https://roost",
            "s3://ro ost",
            "s3://roost/a?b",
            "s3://roost/a//b",
        ] {
            assert_eq!(wrong.parse::<Bucket>(), Err(BucketError::NotS3), "{wrong}");
        }
    }
}
