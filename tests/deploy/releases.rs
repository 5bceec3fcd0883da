//! What a release has: the features of its builds, and the signatures of its image and files.

use std::path::Path;

#[test]
fn released_builds_support_buckets() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut builds = 0;
    for name in ["deploy/Containerfile", ".github/workflows/release.yml", "docs/howto/install.md"] {
        let text = std::fs::read_to_string(root.join(name)).unwrap();
        let commands =
            if name.ends_with(".md") { "cargo deb " } else { "cargo build |cargo deb |cargo cyclonedx " };
        let is_build = |line: &&str| commands.split('|').any(|command| line.contains(command));
        for line in text.lines().filter(is_build) {
            assert!(line.contains(" --features s3"), "{name}: {line}");
            builds += 1;
        }
    }
    assert_eq!(builds, 5);
}

/// Signatures name what they sign by its digest, and no action can change under its name.
#[test]
fn released_images_and_files_are_signed_by_digest() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join(".github/workflows/release.yml")).unwrap();
    for part in [
        "IMAGE: ${{ steps.join.outputs.name }}@${{ steps.join.outputs.digest }}",
        "cosign sign --yes \"$IMAGE\"",
        "cosign sign-blob --yes --new-bundle-format --bundle SHA256SUMS.sigstore.json SHA256SUMS",
    ] {
        assert!(text.contains(part), "{part}");
    }
    let actions: Vec<&str> =
        text.lines().filter_map(|line| line.split_once("uses: ")).map(|it| it.1).collect();
    assert!(actions.len() > 10, "{actions:?}");
    assert_eq!(
        actions.iter().filter(|action| action.starts_with("actions/attest-build-provenance@")).count(),
        2
    );
    for action in actions {
        let commit = action.split_once('@').and_then(|(_, rest)| rest.split(' ').next()).unwrap_or_default();
        assert!(commit.len() == 40 && commit.bytes().all(|byte| byte.is_ascii_hexdigit()), "{action}");
    }
}
