# `make demo` and `make test` do all their own set-up. `make help` lists the rest.

CARGO := cargo
BIN := target/release
DEMO := target/demo

.PHONY: help setup build firmware demo test lint doc bench clean

help:
	@echo "make demo      record a trial on the emulated board, from nothing to a log"
	@echo "make test      all tests"
	@echo "make build     biflag, the emulated board and the firmware image, in $(BIN) and target"
	@echo "make lint      format and lint checks"
	@echo "make doc       the documentation for those who carry on the work"
	@echo "make setup     what the others need from the system, installed where possible"
	@echo "make clean     remove what was built"

setup:
	@sh firmware/setup.sh

firmware: setup
	@sh firmware/build.sh

build: firmware
	$(CARGO) build --release --bin biflag
	$(CARGO) build --release -p virtual-nano

demo: build
	@rm -rf $(DEMO)
	$(BIN)/biflag record host/plans/hand-turn-z.toml --virtual=tests/data/mpu6050/rotate-z-720.csv --out $(DEMO)
	@$(BIN)/biflag info $(DEMO)/*.mcap
	@echo "The log is in $(DEMO). Open it in Foxglove or PlotJuggler, or: $(BIN)/biflag export $(DEMO)/*.mcap"

test: build
	@sh firmware/setup.sh test
	$(CARGO) test --workspace --locked

lint: setup
	$(CARGO) fmt --all --check
	$(CARGO) clippy --workspace --all-targets --locked -- -D warnings

doc: setup
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --workspace --no-deps --locked

clean:
	$(CARGO) clean
