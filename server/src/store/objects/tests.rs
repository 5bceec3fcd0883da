//! Tests of the life of objects: in a folder and, by hand, in a bucket (`tests/s3/run.sh`).

use std::io;

use futures_util::stream;

use super::*;

/// Longer than two parts of a bucket, and no multiple of a part.
fn long() -> Bytes {
    (0..2 * BUCKET_PART_BYTES + 12_345).map(|place| (place % 251) as u8).collect()
}

async fn stage(objects: &Objects, bytes: &Bytes, limit: usize) -> Result<Staged, StageError<io::Error>> {
    let pieces: Vec<_> = bytes.chunks(1_000_003).map(|piece| Ok(bytes.slice_ref(piece))).collect();
    objects.stage(stream::iter(pieces), limit as u64).await
}

async fn read(objects: &Objects, digest: &str, part: Range<u64>) -> Option<Vec<u8>> {
    let pieces: Vec<Bytes> = objects.read(digest, part).await.unwrap()?.try_collect().await.unwrap();
    Some(pieces.concat())
}

async fn check_life(objects: Objects, reopen: impl AsyncFnOnce() -> Objects) {
    let (long, short, empty) = (long(), Bytes::from_static(b"short"), Bytes::new());
    let mut digests = Vec::new();
    for bytes in [&long, &short, &empty] {
        let staged = stage(&objects, bytes, bytes.len()).await.expect("within the limit");
        assert_eq!(staged.digest, blake3::hash(bytes).to_string());
        assert_eq!(staged.bytes, bytes.len() as u64);
        assert!(bytes.starts_with(&staged.head) && staged.head.len() == bytes.len().min(HEAD_BYTES));
        digests.push(staged.digest.clone());
        assert_eq!(
            read(&objects, &staged.digest, 0..1).await,
            None,
            "an upload without a name cannot be read"
        );
        drop(objects.publish(staged).await.unwrap());
    }
    assert_eq!(read(&objects, &digests[0], 0..long.len() as u64).await.unwrap(), long);
    let (from, to) = (BUCKET_PART_BYTES as u64 - 3, BUCKET_PART_BYTES as u64 + 4);
    assert_eq!(read(&objects, &digests[0], from..to).await.unwrap(), long[from as usize..to as usize]);
    assert_eq!(read(&objects, &digests[1], 1..3).await.unwrap(), b"ho");

    // Equal bytes are one object. Discarded and too long uploads leave none.
    let again_short = stage(&objects, &short, 5).await.expect("within the limit");
    drop(objects.publish(again_short).await.unwrap());
    assert!(matches!(stage(&objects, &long, long.len() - 1).await, Err(StageError::TooLong)));
    let unwanted = stage(&objects, &Bytes::from_static(b"unwanted"), 8).await.expect("within the limit");
    objects.discard(unwanted).await;
    let interrupted =
        stage(&objects, &Bytes::from_static(b"interrupted"), 11).await.expect("within the limit");

    let listed = async |objects: &Objects, before_ms| {
        let mut names = objects.older_than(before_ms).await.unwrap();
        names.sort();
        names
    };
    digests.sort();
    assert_eq!(listed(&objects, i64::MAX).await, digests, "uploads have no names yet");
    assert_eq!(listed(&objects, 0).await, [""; 0]);
    assert!(objects.files.head(&interrupted.place).await.is_ok());
    let objects = reopen().await;
    assert!(objects.files.head(&interrupted.place).await.is_ok(), "another server may lead");
    objects.remove_unfinished().await.unwrap();
    assert!(
        objects.files.head(&interrupted.place).await.is_err(),
        "the next server that leads removes interrupted uploads"
    );
    assert_eq!(listed(&objects, i64::MAX).await, digests);

    for digest in &digests {
        assert!(objects.remove(digest).await.unwrap());
        assert_eq!(read(&objects, digest, 0..1).await, None);
    }
    assert_eq!(listed(&objects, i64::MAX).await, [""; 0]);
}

#[tokio::test]
async fn object_life_cycle_in_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let open = async || Objects::open(folder.path(), None).await.unwrap();
    check_life(open().await, open).await;
}

#[cfg(feature = "s3")]
#[tokio::test]
#[ignore = "needs a bucket, which ROOST_TEST_BUCKET names: tests/s3/run.sh"]
async fn object_life_cycle_in_a_bucket() {
    let bucket = std::env::var("ROOST_TEST_BUCKET").expect("ROOST_TEST_BUCKET=s3://BUCKET/PREFIX");
    let bucket: Bucket = bucket.parse().unwrap();
    let open = async || Objects::open(Path::new("nowhere"), Some(&bucket)).await.unwrap();
    check_life(open().await, open).await;
    assert!(!Path::new("nowhere").exists());

    let elsewhere: Bucket = "s3://no-such-bucket/prefix".parse().unwrap();
    let error = Objects::open(Path::new("nowhere"), Some(&elsewhere)).await.unwrap_err();
    assert!(error.to_string().contains("s3://no-such-bucket/prefix"), "{error}");
}
