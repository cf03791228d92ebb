# `make demo` and `make test` do all their own set-up. `make help` lists the rest.

CARGO := cargo
BIN := target/release
DEMO := target/demo
KILLS ?= 1000

.PHONY: help setup build firmware demo test proof hostile mutants lint doc clean

help:
	@echo "make demo      record trials on the emulated board, fit and run the model, write the report"
	@echo "make test      all tests"
	@echo "make proof     long checks: fits to robots with unknown parameters, 10000 random cases, speed; two hours"
	@echo "make hostile   $(KILLS) kills of a recording, a log changed at every byte, spoilt lines, lost frames; an hour"
	@echo "make mutants   changes of protocol and firmware that their tests do not notice; half an hour on two free cores"
	@echo "make build     biflag, the emulated board and the firmware image, in $(BIN) and target"
	@echo "make lint      format and lint checks"
	@echo "make doc       the documentation for contributors"
	@echo "make setup     install the system packages that the others need"
	@echo "make clean     remove what was built"

setup:
	@sh firmware/setup.sh

firmware: setup
	@sh firmware/build.sh

# One command for both programs, and one profile for programs and tests: each crate is compiled once.
build: firmware
	$(CARGO) build --release --locked -p host -p virtual-nano --bins

# Exit code 3: done with warnings, which do not end the demo.
demo: build
	@rm -rf $(DEMO)
	@echo "A real sensor, turned by hand through 720 degrees about z and recorded; its counts replayed through the real firmware:"
	$(BIN)/biflag record host/plans/hand-turn-z.toml --virtual=tests/data/mpu6050/rotate-z-720.csv --out $(DEMO)/hand-turn
	@echo "Two trials on the emulated board with the simulated robot behind it:"
	$(BIN)/biflag record host/plans/demo.toml --virtual --out $(DEMO)/robot
	@echo "The robot's parameters, fitted to these trials:"
	$(BIN)/biflag calibrate $(DEMO)/robot -o $(DEMO)/fitted.toml --fit tether,righting || [ $$? = 3 ]
	@echo "The trials compared with the model with these parameters:"
	$(BIN)/biflag compare $(DEMO)/robot --robot $(DEMO)/fitted.toml || [ $$? = 3 ]
	@echo "Open $(DEMO)/robot/compare.html in a browser, and the logs in Foxglove or PlotJuggler."

test: build
	@sh firmware/setup.sh test
	$(CARGO) test --release --workspace --locked --no-fail-fast

proof: build
	@sh firmware/setup.sh test
	SIM_HARD_CASES=10000 $(CARGO) test --release --locked -p sim --test all hard_cases -- --nocapture
	$(CARGO) test --release --locked -p host --test all calibration -- --ignored --nocapture
	$(CARGO) test --release --locked -p tests --test attitude_chain --test twin --test report -- --ignored --nocapture
	$(CARGO) bench --locked -p sim --bench trials
	$(CARGO) run --release --locked -p sim --example steady -- physical 2

hostile: build
	KILLS=$(KILLS) $(CARGO) test --release --locked -p tests --test interruption killed -- --nocapture
	EVERY_BYTE=1 $(CARGO) test --release --locked -p tests --test every_byte -- --nocapture
	LINES=100 $(CARGO) test --release --locked -p tests --test spoilt_line only -- --nocapture
	FRAMES=1000000 $(CARGO) test --release --locked -p tests --test link at_random -- --nocapture
	PHASES=1000 $(CARGO) test --release --locked -p virtual-nano --test link silent_host -- --nocapture
	BIFLAG_DAMAGE=100000000 $(CARGO) test --release --locked -p protocol --test wire damage -- --nocapture

# What is left out, and why: .cargo/mutants.toml. In the development profile, which compiles a change in a tenth of the time.
mutants:
	@command -v cargo-mutants >/dev/null || $(CARGO) install --locked cargo-mutants
	$(CARGO) mutants -p protocol -p firmware --baseline=skip --timeout 60 --jobs 2

lint: setup
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets --locked -- -D warnings

doc: setup
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --workspace --no-deps --locked

clean:
	$(CARGO) clean
