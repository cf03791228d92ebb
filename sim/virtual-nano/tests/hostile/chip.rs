//! Supply, clock and a program that hangs.

use super::{Host, off_after, row, stops, turning, until};
use crate::common::{MS, TICK, firmware};
use protocol::units::{CentiRpm, Duty};
use protocol::{Command, Fault, Reply, ResetCause};
use virtual_nano::bootloader::Bootloader;
use virtual_nano::{Board, BoardOptions};

#[test]
fn a_hang_stops_the_motors_with_interrupts_on_and_off() {
    for (interrupts, limit_ms) in [(true, 32.0), (false, 64.0)] {
        let mut host = turning([60.0, -40.0]);
        let begin = host.board.cycle();
        host.hang(interrupts);
        let limit = (limit_ms * MS as f64) as u64 + TICK;
        let off = host.run_until_off(4 * limit) - begin;
        let info = host.hello();
        row(
            format!("hang with interrupts {}", if interrupts { "on" } else { "off" }),
            format!("off after {:.1} ms, then {:?}", off as f64 / MS as f64, info.reset_cause),
            format!("{:.0} ms", limit as f64 / MS as f64),
        );
        assert!(off <= limit, "off after {off} cycles");
        assert!(matches!(info.reset_cause, ResetCause::Hang | ResetCause::Watchdog), "{:?}", info.reset_cause);
        host.stream();
        host.run_ms(200);
        assert_eq!(host.fault(), Fault::Hang);
        host.order(Command::ClearFault);
        host.set_speeds([30.0, 30.0]);
        host.run_linked_ms(500);
        assert_eq!(host.fault(), Fault::None);
    }
}

#[test]
fn ticks_that_are_missed_are_counted() {
    let mut host = turning([30.0, 30.0]);
    let mut rows = Vec::new();
    for (ms, wanted) in [(4.0, 0..=1), (11.0, 1..=2), (21.0, 3..=4)] {
        let (before, begin) = (host.last().missed_ticks.0, host.last().time);
        host.inject(&format!("busy={ms}"));
        host.run_linked_ms(100);
        let missed = host.last().missed_ticks.0.wrapping_sub(before);
        let ticks = host.telemetry.iter().filter(|(_, frame)| frame.time.since(begin) < 100_000).count() - 1;
        row(
            format!("busy for {ms} ms"),
            format!("{missed} ticks missed, {ticks} frames in 0.1 s"),
            format!("{wanted:?}"),
        );
        rows.push((missed, wanted, ticks));
    }
    assert_eq!(host.fault(), Fault::None);
    for (missed, wanted, ticks) in rows {
        assert!(wanted.contains(&missed) && (19..=20).contains(&(ticks + usize::from(missed))), "{missed}, {ticks}");
    }
}

#[test]
fn the_supply_is_told_and_too_little_stops_the_motors() {
    let mut host = turning([50.0, 50.0]);
    for mv in [4800, 5200] {
        host.inject(&format!("supply={mv}"));
        host.run_linked_ms(1100);
        let told = host.last().supply.0;
        row(format!("supply of {mv} mV"), format!("{told} mV told"), "within 0.5 %");
        assert!(f64::from(told.abs_diff(mv)) < 0.005 * f64::from(mv), "{told} of {mv} mV");
        assert_eq!(host.fault(), Fault::None);
    }
    // The data sheet allows the reference 9 % either way: without a calibration the supply is told as wrong.
    host.inject("supply=5000");
    for (mv, wanted) in [(1000, 5500), (1200, 4583)] {
        host.inject(&format!("bandgap={mv}"));
        host.run_linked_ms(1100);
        let told = host.last().supply.0;
        row(format!("5000 mV, bandgap of {mv} mV"), format!("{told} mV told"), format!("{wanted}, no fault"));
        assert!(told.abs_diff(wanted) < 30 && host.fault() == Fault::None, "{told}, {:?}", host.fault());
    }
    host.inject("bandgap=1100");
    host.inject("supply=4200");
    stops(&mut host, "supply of 4200 mV", 1.1, &[Fault::SupplyLow]);
}

/// The supply is measured four times a second, and two low readings stop the motors.
#[test]
fn a_sag_of_half_a_second_stops_the_motors() {
    for ms in [50, 100, 200, 300, 510] {
        let mut host = turning([50.0, 50.0]);
        host.inject("supply=4200");
        host.run_linked_ms(ms);
        host.inject("supply=5000");
        host.run_linked_ms(300);
        let lowest = host.telemetry.iter().map(|(_, frame)| frame.supply.0).filter(|mv| *mv > 0).min().unwrap();
        row(
            format!("supply of 4200 mV for {ms} ms"),
            format!("{:?}, at least {lowest} mV told", host.fault()),
            "SupplyLow after 0.5 s",
        );
        assert!(ms < 500 || host.fault() == Fault::SupplyLow, "{ms} ms");
    }
}

#[test]
fn a_brown_out_stops_the_motors_at_once_and_is_told() {
    let mut host = turning([50.0, 50.0]);
    host.cut();
    host.inject("brown-out=50");
    let off_s = off_after(&mut host, 1.0);
    host.run_ms(60);
    let info = host.hello();
    row("brown-out", format!("off after {:.4} s, then {:?}", off_s.unwrap(), info.reset_cause), "at once, BrownOut");
    assert_eq!((off_s, info.reset_cause), (Some(0.0), ResetCause::BrownOut));
}

#[test]
fn a_resonator_off_by_half_a_percent_changes_nothing_but_the_clock() {
    for percent in [-0.5, 0.5] {
        let mut host = Host::ready(BoardOptions::default());
        host.inject(&format!("resonator={percent}"));
        host.set_speeds([50.0, -50.0]);
        host.run_linked_ms(2000);
        let (begin_s, begin) = (host.board.seconds(), host.last().time);
        host.run_linked_ms(4000);
        let ratio = f64::from(host.last().time.since(begin)) * 1e-6 / (host.board.seconds() - begin_s);
        // The board takes its own seconds for seconds.
        let rpm = host.board.rig().motors[0].speed_rpm;
        row(
            format!("resonator {percent:+} %"),
            format!("clock {:+.2} %, 50 rpm are {rpm:.2}", 100.0 * (ratio - 1.0)),
            "the same, 0.5 rpm",
        );
        assert!((ratio - 1.0 - percent / 100.0).abs() < 0.002, "{ratio}");
        assert!((rpm - 50.0).abs() < 1.0 && host.fault() == Fault::None);
        assert_eq!((host.last().bad_frames.0, host.last().missed_ticks.0), (0, 0));
    }
}

#[test]
fn a_ping_tells_when_it_was_read() {
    let mut host = Host::ready(BoardOptions::default());
    let (mut least, mut most) = (u32::MAX, 0);
    for wait in 0..50 {
        host.run_until(host.board.cycle() + TICK + 997 * wait);
        let begin = host.board.cycle();
        let answer = host.ask(Command::Ping);
        let Reply::Pong(time) = answer else { panic!("{answer:?}") };
        let sent = host.board.rig().clock.at(begin).unwrap();
        (least, most) = (least.min(time.since(sent)), most.max(time.since(sent)));
    }
    // Six bytes last 120 us.
    row("a ping's time after it was sent", format!("{least} to {most} us"), "119 to 200 us");
    assert!(least >= 119 && most <= 200, "{least} to {most} us");
}

#[test]
fn telemetry_tells_the_time_of_the_chip() {
    let mut host = turning([0.0, 0.0]);
    let frames = |host: &Host| (host.last().time, host.telemetry.last().unwrap().0);
    let (begin, cycle) = frames(&host);
    host.run_linked_ms(5000);
    let (end, until_cycle) = frames(&host);
    let (told, passed) = (f64::from(end.since(begin)), (until_cycle - cycle) as f64 / 16.0);
    row("5 s of telemetry", format!("{told} us of {passed:.0}"), "within 200 us");
    assert!((told - passed).abs() < 200.0);
}

#[test]
fn a_packet_of_the_usb_bridge_loses_nothing() {
    let mut host = turning([30.0, 30.0]);
    host.inject("usb=16,32");
    let first = host.last().seq.0;
    let frames = host.telemetry.len();
    assert!(until(&mut host, 0.5, |host| host.last().seq.0.wrapping_sub(first) >= 60).is_some());
    let got = host.telemetry.len() - frames;
    row(
        "USB packets of 32 bytes or 16 ms",
        format!("{got} frames of {}", host.last().seq.0.wrapping_sub(first)),
        "all",
    );
    assert_eq!(got, usize::from(host.last().seq.0.wrapping_sub(first)));
}

/// Returns a board behind a bootloader that turns its flagella at these speeds.
fn turning_behind(bootloader: Bootloader, rpm: [f64; 2]) -> Host {
    let (loader, program) = (bootloader.load().unwrap(), firmware());
    assert!(program.end() <= loader.start(), "a program that reaches into the bootloader");
    let mut board = Board::with_bootloader(&loader, BoardOptions::default()).unwrap();
    program.segments.iter().for_each(|(address, bytes)| assert!(board.mcu.write_flash(*address, bytes)));
    let mut host = Host::with(board);
    wait_for_program(&mut host);
    host.hello();
    host.stream();
    host.run_ms(200);
    host.set_speeds(rpm);
    host.run_linked_ms(1500);
    assert_eq!(host.fault(), Fault::None, "before anything fails");
    host
}

/// Runs until the bootloader has given up waiting for a host; the old one takes seconds.
fn wait_for_program(host: &mut Host) {
    for _ in 0..80 {
        host.board.run_for(100 * MS);
        if host.board.mcu.pc() < 0x7000 {
            break;
        }
    }
    // An entry of the fault log takes 20 ticks to write.
    host.board.run_for(300 * MS);
    host.board.take_serial();
}

#[test]
fn a_reset_in_a_run_is_told_behind_a_bootloader_that_hides_its_cause() {
    type Reset = fn(&mut Host);
    let resets: [(&str, Reset); 4] = [
        ("hang with interrupts on", |host| host.hang(true)),
        ("hang with interrupts off", |host| host.hang(false)),
        ("brown-out", |host| {
            host.cut();
            host.inject("brown-out=50");
        }),
        ("reset by button or port", Host::reset),
    ];
    for bootloader in [Bootloader::Optiboot, Bootloader::Old] {
        for (what, reset) in resets {
            if bootloader == Bootloader::Old && what == "hang with interrupts off" {
                continue;
            }
            let mut host = turning_behind(bootloader, [61.3, -37.8]);
            host.cut();
            reset(&mut host);
            let off_s = off_after(&mut host, 0.1).expect("off within 100 ms");
            wait_for_program(&mut host);
            let info = host.hello();
            let Reply::FaultRecord(record) = host.ask(Command::ReadFault { index: 0 }) else { panic!("no record") };
            row(
                format!("{what} behind {bootloader:?}"),
                format!("off after {:.1} ms, then {:?}, {:?} logged", off_s * 1e3, info.reset_cause, record.fault),
                "100 ms, logged",
            );
            assert_eq!(record.fault, Fault::Hang);
            host.stream();
            host.run_ms(200);
            assert_eq!(host.fault(), Fault::Hang, "the motors wait for the user");
            // Without a run nothing is told.
            host.order(Command::ClearFault);
            host.reset();
            wait_for_program(&mut host);
            host.hello();
            host.stream();
            host.run_ms(200);
            assert_eq!(host.fault(), Fault::None);
        }
    }
}

/// What a motor takes from rest at full duty pulls the supply down within a millisecond.
#[test]
fn a_brown_out_as_soon_as_a_motor_is_on_leaves_a_trace() {
    for (what, command) in [
        ("a drive", Command::Drive { duty: [Duty(255), Duty(0)], duration_ms: 500 }),
        ("speeds", Command::SetSpeeds([CentiRpm(6130), CentiRpm(-3780)])),
    ] {
        for ms in [1, 2, 3] {
            let mut host = Host::ready(BoardOptions::default());
            host.send(command);
            while host.board.rig().bridge.pwm == [0, 0] {
                host.run_until(host.board.cycle() + MS / 50);
            }
            host.run_ms(ms);
            host.cut();
            host.inject("brown-out=3");
            // An entry of the fault log takes 20 ticks to write.
            host.run_ms(200);
            host.hello();
            let Reply::FaultRecord(record) = host.ask(Command::ReadFault { index: 0 }) else { panic!("no record") };
            row(format!("brown-out {ms} ms after the begin of {what}"), format!("{:?} logged", record.fault), "Hang");
            assert_eq!(record.fault, Fault::Hang, "{ms} ms after the begin of {what}");
        }
    }
}

/// The watchdog stays on after its reset, and the old bootloader, which does not turn it off, takes longer than its time.
#[test]
fn a_hang_with_interrupts_off_behind_the_old_bootloader_leaves_the_motors_off() {
    let mut host = turning_behind(Bootloader::Old, [61.3, -37.8]);
    host.hang(false);
    let off_s = off_after(&mut host, 0.1).expect("off within 100 ms");
    row(
        "hang with interrupts off behind Old",
        format!("off after {:.1} ms, no answer until it is unplugged", off_s * 1e3),
        "100 ms, off for good",
    );
    for _ in 0..300 {
        host.board.run_for(10 * MS);
        assert_eq!(host.board.rig().bridge.pwm, [0, 0]);
    }
}
