use super::*;
use crate::storage::tests::{End, Memory};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// A board with its memory, and where its shafts are.
struct Board {
    memory: Memory,
    positions: Positions,
    told: [EncoderCounts; 2],
    at_rest: bool,
}

impl Board {
    fn start(memory: &Memory) -> Self {
        let mut positions = Positions::default();
        let told = positions.open(&mut memory.clone(), 7).unwrap_or_default();
        Self { memory: memory.clone(), positions, told, at_rest: true }
    }

    /// Returns a board that was aligned, with its record.
    fn aligned() -> Self {
        let mut board = Self::start(&Memory::blank());
        board.positions.align();
        board.write_out();
        board
    }

    fn tick(&mut self) -> bool {
        self.positions.step(&mut self.memory, &self.told, self.at_rest)
    }

    /// Runs until nothing is written; returns the writes.
    fn write_out(&mut self) -> u32 {
        (0..100).find(|_| !self.tick()).unwrap()
    }

    /// Turns the shafts by these counts, and lets them come to rest.
    fn turn(&mut self, counts: [i32; 2]) {
        self.at_rest = false;
        self.write_out();
        assert!(self.positions.may_change());
        for (told, counts) in self.told.iter_mut().zip(counts) {
            told.0 = told.0.wrapping_add(counts);
        }
        self.at_rest = true;
        self.write_out();
    }
}

fn opened(memory: &Memory) -> Option<[EncoderCounts; 2]> {
    Positions::default().open(&mut memory.clone(), 0)
}

#[test]
fn a_memory_without_a_record_knows_nothing_and_writes_nothing() {
    for content in [0xFF, 0, VALID] {
        let memory = Memory::blank();
        memory.bytes.borrow_mut().fill(content);
        let mut board = Board::start(&memory);
        assert!(!board.positions.are_known() && board.positions.may_change());
        board.turn([5, -7]);
        assert_eq!((opened(&memory), memory.writes.borrow().iter().sum::<u32>()), (None, 0), "{content}");
    }
}

#[test]
fn the_positions_of_the_last_rest_are_found_and_those_of_a_turn_are_not() {
    let mut board = Board::aligned();
    assert_eq!(opened(&board.memory), Some([EncoderCounts(0); 2]));
    board.turn([1_000_000, -3]);
    board.turn([i32::MAX - 1_000_000, -500]);
    assert_eq!(opened(&board.memory), Some([EncoderCounts(i32::MAX), EncoderCounts(-503)]));
    board.at_rest = false;
    assert!(!board.positions.may_change(), "the record holds until it is cleared");
    assert_eq!(board.write_out(), 1);
    assert!(board.positions.may_change() && board.positions.are_known());
    assert_eq!(opened(&board.memory), None);
}

#[test]
fn a_lost_position_stays_lost_until_the_shafts_are_aligned_again() {
    let mut board = Board::aligned();
    board.positions.lose();
    board.write_out();
    board.turn([4, 4]);
    assert_eq!(opened(&board.memory), None);
    board.told = [EncoderCounts(0); 2];
    board.positions.align();
    board.write_out();
    board.turn([-9, 2]);
    assert_eq!(opened(&board.memory), Some([EncoderCounts(-9), EncoderCounts(2)]));
    // A new mark, without a turn.
    board.told = [EncoderCounts(0); 2];
    board.positions.align();
    board.write_out();
    assert_eq!(opened(&board.memory), Some([EncoderCounts(0); 2]));
}

/// Power fails at any moment of turns and rests, also within the write of a byte; turning shafts then keep turning.
#[test]
fn a_loss_of_power_at_any_moment_leaves_right_positions_or_none() {
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut below = |limit: u32| random.next_u32() % limit;
    let (mut board, mut truth) = (Board::aligned(), [0; 2]);
    let (mut right, mut unknown) = (0, 0);
    for cut in 0..100_000 {
        let ticks = 1 + below(40);
        for tick in 0..ticks {
            board.at_rest = board.at_rest != (below(15) == 0);
            let may_turn = !board.at_rest && board.positions.may_change();
            let counts = [0, 1].map(|_| if may_turn { below(9) as i32 - 4 } else { 0 });
            for (motor, counts) in counts.into_iter().enumerate() {
                truth[motor] += counts;
                board.told[motor].0 += counts;
            }
            if tick == ticks - 1 {
                board.memory = board.memory.cut_after(0, End::ALL[below(6) as usize]);
            }
            board.tick();
        }
        if !board.at_rest && board.positions.may_change() {
            truth[0] += below(100) as i32;
        }
        board.memory.power = None;
        board = Board::start(&board.memory);
        if board.positions.are_known() {
            assert_eq!(board.told, truth.map(EncoderCounts), "cut {cut}");
            right += 1;
        } else {
            unknown += 1;
            board.told = [EncoderCounts(0); 2];
            truth = [0; 2];
            board.positions.align();
        }
    }
    assert!(right > 10_000 && unknown > 10_000, "{right} {unknown}");
}

#[test]
fn records_wear_the_memory_evenly_and_leave_the_rest_of_it_alone() {
    const TURNS: u32 = 20 * SLOTS as u32;
    let mut board = Board::aligned();
    for turn in 0..TURNS {
        board.turn([137 + turn as i32, -61]);
    }
    let writes = board.memory.writes.borrow();
    let (before, slots) = writes.split_at(usize::from(ADDRESS));
    assert!(before.iter().all(|writes| *writes == 0));
    // Both ways of the last byte of each slot.
    assert_eq!(slots.iter().max(), Some(&(2 * TURNS / u32::from(SLOTS) + 1)));
}

/// As on a bench where the power fails in every trial: each start has new marks, and a record until its first turn.
#[test]
fn starts_without_known_positions_wear_the_memory_evenly_too() {
    let mut memory = Memory::blank();
    for start in 0..=255 {
        let mut positions = Positions::default();
        assert_eq!(positions.open(&mut memory, start), None);
        positions.align();
        for at_rest in [true, false] {
            assert!((0..40).any(|_| !positions.step(&mut memory, &[EncoderCounts(0); 2], at_rest)));
        }
    }
    let writes = memory.writes.borrow();
    let of_valid = (0..SLOTS).map(|slot| writes[usize::from(address_of(slot)) + RECORD]);
    // 256 of 52 slots, both ways.
    assert!(of_valid.into_iter().all(|writes| (8..=10).contains(&writes)));
}

#[test]
fn a_broken_byte_costs_its_slot_and_never_tells_a_wrong_position() {
    for byte in 0..SLOT {
        // The byte is in the slot of the second record, and breaks before that record is written, then after it.
        let mut board = Board::aligned();
        board.memory.stuck = Some(address_of(9) + byte);
        board.turn([300, 400]);
        assert_eq!(opened(&board.memory), Some([EncoderCounts(300), EncoderCounts(400)]), "{byte}");
        let mut board = Board::aligned();
        board.turn([300, 400]);
        board.memory.stuck = Some(address_of(9) + byte);
        board.at_rest = false;
        board.write_out();
        assert_eq!((opened(&board.memory), board.positions.may_change()), (None, true), "{byte}");
    }
}

#[test]
fn a_memory_that_takes_no_more_writes_keeps_the_motors_waiting_for_a_ninth_of_a_second() {
    let mut board = Board::aligned();
    board.turn([300, -471]);
    let before = *board.memory.writes.borrow();
    board.memory = board.memory.cut_after(0, End::Untouched);
    board.at_rest = false;
    assert_eq!((board.write_out(), board.positions.may_change()), (22, true));
    // Two writes for each byte of the slot, and none beside it.
    let slot = address_of(9)..address_of(10);
    let writes = board.memory.writes.borrow();
    for (address, (writes, before)) in (0..).zip(writes.iter().zip(before)) {
        assert_eq!(writes - before, if slot.contains(&address) { 2 } else { 0 }, "{address}");
    }
}

#[test]
fn two_records_are_none() {
    let mut board = Board::aligned();
    board.turn([1, 2]);
    let marker = usize::from(address_of(8)) + RECORD;
    board.memory.bytes.borrow_mut()[marker] = VALID;
    let mut board = Board::start(&board.memory);
    assert!(!board.positions.are_known());
    board.write_out();
    assert_eq!(opened(&board.memory), None);
}
