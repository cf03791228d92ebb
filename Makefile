# `make demo` and `make test` do all their own set-up. `make help` lists the rest.

CARGO := cargo
BIN := target/release
PUBLISHED := target/published
KILLS ?= 1000

.PHONY: help setup build firmware python demo gallery notebooks published test proof hostile mutants lint doc book dist dist-arm64 dist-windows dist-windows-test wheel dist-test clean

help:
	@echo "make demo      record trials on the emulated board, fit and run the model, write the report"
	@echo "make published the figures of the publication by the model, and its printed numbers beside ours"
	@echo "make gallery   six pages of different kinds, each with the commands that made it; some minutes"
	@echo "make notebooks run the notebooks on the session of make demo, and keep their outputs in them; some minutes"
	@echo "make test      all tests"
	@echo "make proof     long checks: fits to robots with unknown parameters, 10000 random cases, speed; two hours"
	@echo "make hostile   $(KILLS) kills of a recording, a log changed at every byte, spoilt lines, lost frames; an hour"
	@echo "make mutants   changes of protocol and firmware that their tests do not notice; half an hour on two free cores"
	@echo "make build     biflag, the emulated board and the firmware image, in $(BIN) and target"
	@echo "make python    the library of the Python package, and an environment for its tests"
	@echo "make book      the book as HTML, in target/book"
	@echo "make dist      a Debian package and an archive that need no compiler, in target/dist"
	@echo "make dist-arm64  the same for a Raspberry Pi: cross-built, and the model run under QEMU; some minutes"
	@echo "make dist-windows  an archive for Windows: cross-built; some minutes"
	@echo "make dist-windows-test  biflag.exe works under Wine, with the same results as here; some minutes"
	@echo "make wheel     the Python package as a wheel for any Linux; some minutes"
	@echo "make dist-test both in a plain Debian 12, as root; some minutes"
	@echo "make lint      format, lints, and the types of the Python package"
	@echo "make doc       the documentation for contributors"
	@echo "make setup     install the system packages that the others need"
	@echo "make clean     remove what was built"

setup:
	@sh firmware/setup.sh

firmware: setup
	@sh firmware/build.sh

# Builds the image and, at the same time, everything but `biflag`, which takes the image in.
build: setup
	@mkdir -p target
	@sh firmware/build.sh > target/firmware.log 2>&1 & image=$$!; \
	$(CARGO) build --release --locked -p page -p rig -p virtual-nano && \
	{ wait $$image || { cat target/firmware.log >&2; exit 1; }; } && \
	$(CARGO) build --release --locked -p host -p virtual-nano --bins

# It builds first, behind a line of progress.
demo: setup
	@sh host/demo.sh

gallery: build
	@sh host/gallery.sh

notebooks: demo
	python3 -m venv target/notebooks
	target/notebooks/bin/pip install -q -r host/python/tests/requirements.txt -r host/python/tests/requirements-newest.txt ./host/python
	cd host/python && BIFLAG_SESSION=../../../target/demo/robot ../../target/notebooks/bin/python -m pytest -q \
		--nbmake --overwrite --nbmake-timeout=300 notebooks
	target/notebooks/bin/python host/python/store_outputs.py host/python/notebooks/*.ipynb

# With the publication's own model, the closure `lumped`.
published: build
	@rm -rf $(PUBLISHED)
	$(BIN)/biflag simulate host/plans/published-points.toml --closure lumped --out $(PUBLISHED)/points || [ $$? = 3 ]
	@echo "The publication prints: (50, 10) rpm: |yaw| 67.95 measured, 60.76 simulated, |pitch| 4.96 measured, 3.29 simulated;"
	@echo "(0, 45): |yaw| 56.22, |pitch| 3.45 simulated; (90, 90): |yaw| 180; (-90, 90): |pitch| 16, degrees."
	$(BIN)/biflag simulate host/plans/published-map.toml --closure lumped --out $(PUBLISHED)/map || [ $$? = 3 ]
	$(BIN)/biflag figure trial $(PUBLISHED)/points/001_w1+50_w2+10.mcap -o $(PUBLISHED)/trial.pdf
	$(BIN)/biflag figure forces $(PUBLISHED)/points/001_w1+50_w2+10.mcap --time 100,112 -o $(PUBLISHED)/forces.pdf
	$(BIN)/biflag figure map $(PUBLISHED)/map -o $(PUBLISHED)/map.pdf

# The library of the Python package, and the environment of its tests.
python: setup
	$(CARGO) build --release --locked -p biflag-python
	@sh tests/python.sh newest

# Most tests wait for a board, a program or a browser half of their time.
test: export RUST_TEST_THREADS ?= $(shell echo $$((2 + $$(nproc))))
test: build python
	@sh firmware/setup.sh test
	@rm -rf target/times
	@$(CARGO) test --config 'target."cfg(unix)".runner=["$(CURDIR)/tests/timed.sh"]' --release --workspace --locked --no-fail-fast --tests \
		-- --skip real_time::; \
	programs=$$?; $(CARGO) test --release --locked --workspace --test all real_time:: -- --test-threads 1; real_time=$$?; \
	$(CARGO) test --release --workspace --locked --doc; documents=$$?; \
	echo "\nThe slowest tests, in seconds:"; \
	(cd target/times && awk '/>$$/ { split(FILENAME, of, " "); gsub(/[<>s]/, "", $$NF); print $$NF, of[1], $$2 }' *) | sort -rn | head -n 20; \
	[ $$programs$$real_time$$documents = 000 ]

# The demo stops where a number of its story is not in the output of its command.
proof: demo
	@sh firmware/setup.sh test
	$(CARGO) test --release --locked -p biflag-log --features generate --test schema
	@sh firmware/setup.sh proof
	for cpu in Haswell Nehalem qemu64; do CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER="qemu-x86_64 -cpu $$cpu" \
		$(CARGO) test --release --locked -p sim --lib same_bits || exit; done
	SIM_HARD_CASES=10000 $(CARGO) test --release --locked -p sim --test all hard_cases -- --nocapture
	$(CARGO) test --release --locked -p host --test all calibration -- --ignored --nocapture
	$(CARGO) test --release --locked -p study --lib swing -- --ignored --nocapture
	AIM_CASES=200 $(CARGO) test --release --locked -p host --test all aim -- --ignored --nocapture
	$(CARGO) test --release --locked -p tests --test all -- --ignored --nocapture
	$(CARGO) bench --locked -p sim --bench trials
	$(CARGO) run --release --locked -p sim --example steady -- physical 2

hostile: build
	KILLS=$(KILLS) $(CARGO) test --release --locked -p tests --test all interruption::killed -- --nocapture
	KILLS=50 $(CARGO) test --release --locked -p tests --test all sweep::killed -- --nocapture
	KILLS=50 $(CARGO) test --release --locked -p tests --test all simulate::killed -- --nocapture
	ROUNDS=20 $(CARGO) test --release --locked -p tests --test all sweep_together -- --nocapture
	EVERY_BYTE=1 $(CARGO) test --release --locked -p tests --test every_byte -- --nocapture
	LINES=100 $(CARGO) test --release --locked -p tests --test all spoilt_line::only -- --nocapture
	FRAMES=1000000 $(CARGO) test --release --locked -p tests --test all link::frames_dropped_at_random -- --nocapture
	POLICY_KILLS=100 $(CARGO) test --release --locked -p tests --test all steer::killed -- --nocapture
	SPIKES_WHOLE=1 $(CARGO) test --release --locked -p virtual-nano --test all pwm_spikes -- --nocapture
	FREE_WHOLE=1 $(CARGO) test --release --locked -p virtual-nano --test all free_motors -- --nocapture
	PHASES_WHOLE=1 $(CARGO) test --release --locked -p virtual-nano --test all phase -- --nocapture
	PHASES=1000 $(CARGO) test --release --locked -p virtual-nano --test all silent_host -- --nocapture
	CUTS=1000 $(CARGO) test --release --locked -p virtual-nano --test all hostile::positions -- --nocapture
	BIFLAG_DAMAGE=100000000 $(CARGO) test --release --locked -p protocol --test wire damage -- --nocapture

# What is left out, and why: .cargo/mutants.toml. In the development profile, which compiles a change in a tenth of the time.
mutants:
	@command -v cargo-mutants >/dev/null || $(CARGO) install --locked cargo-mutants
	$(CARGO) mutants -p protocol -p firmware --baseline=skip --timeout 60 --jobs 2

lint: python
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets --locked -- -D warnings
	sh host/python/types.sh

doc: setup
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --workspace --no-deps --locked

book:
	@command -v mdbook >/dev/null || $(CARGO) install --locked mdbook
	mdbook build host/book

# What a build keeps for the next one is of no use here.
dist: export CARGO_INCREMENTAL := 0
dist: build
	@sh firmware/setup.sh dist
	@sh host/dist/package.sh

dist-arm64: export CARGO_INCREMENTAL := 0
dist-arm64: build
	@sh firmware/setup.sh arm64
	@sh host/dist/arm64.sh
	@sh host/dist/package.sh arm64

dist-windows: export CARGO_INCREMENTAL := 0
dist-windows: build
	@sh firmware/setup.sh windows
	@sh host/dist/windows.sh

dist-windows-test: dist-windows
	@sh host/dist/windows-test.sh

# One wheel for every Python from 3.10 on, on any Linux with glibc 2.17: zig links it. Into target/dist.
wheel: export CARGO_INCREMENTAL := 0
wheel: setup
	python3 -m venv target/wheel
	target/wheel/bin/pip install -q 'maturin>=1.9,<2' ziglang
	cd host/python && PATH="$$PWD/../../target/wheel/bin:$$PATH" CARGO_TARGET_DIR="$$PWD/../../target/wheel/target" maturin build --release --zig \
		--compatibility manylinux2014 --out ../../target/dist

dist-test: dist
	@sh host/dist/test.sh

clean:
	$(CARGO) clean
