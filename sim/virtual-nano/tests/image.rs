//! The program's cost in flash, memory and time, printed as a table.

use crate::common::{Host, TICK, firmware};
use protocol::{Command, Fault, Settings};
use virtual_nano::BoardOptions;

/// Of 30,720 bytes beside the bootloader.
const FLASH: u64 = 30_300;
/// Of 2,048 bytes.
const RAM: u64 = 1_480;
/// Of 80,000 cycles.
const WORST_TICK: u64 = 60_000;

#[test]
fn the_image_fits_with_room_to_spare() {
    let image = firmware();
    let mut host = Host::ready(BoardOptions::default());
    // Everything at once: both motors, full telemetry, a calibration before, settings saved meanwhile, a dense host.
    host.order(Command::CalibrateGyro { duration_ms: 500 });
    host.run_linked_ms(700);
    host.order(Command::WriteSettings(Settings { board_id: 5, ..Settings::DEFAULT }));
    host.set_speeds([90.0, -90.0]);
    host.run_linked_ms(1000);
    host.order(Command::SaveSettings);
    for _ in 0..200 {
        host.send(Command::ReadSettings);
        host.run_ms(7);
    }
    let tick = host.board.rig().marks.tick;
    let (statics, stack) = (host.board.static_bytes.unwrap(), host.board.deepest_stack().unwrap());
    let ram = u64::from(statics + stack);
    let rows = [
        ("flash, bytes", image.flash_bytes() as u64, FLASH),
        ("static RAM and deepest stack, bytes", ram, RAM),
        ("worst tick, cycles", tick.worst, WORST_TICK),
    ];
    println!("| what | value | limit |");
    println!("| --- | ---: | ---: |");
    for (what, value, limit) in rows {
        println!("| {what} | {value} | {limit} |");
    }
    println!("(static RAM {statics}, stack {stack}, mean tick {} of {TICK} cycles)", tick.mean());
    for (what, value, limit) in rows {
        assert!(value <= limit, "{what}: {value} is more than {limit}");
    }
    assert!(tick.count > 500);
    let told = u64::from(host.hello().ram_left);
    assert_eq!(told, 2048 - ram, "the program knows how far its stack has come");
    assert_eq!(host.board.mcu.serial_overruns(), 0, "the program read bytes too late");
    assert_eq!(host.last().missed_ticks.0, 0);
}

/// What the host asks for again and again, and what else goes on.
struct Load {
    name: &'static str,
    requests: &'static [Command],
    /// Of the line's 50,000 bytes a second.
    share: f64,
    /// Whether both motors turn; they must not while settings are written.
    turning: bool,
    /// On the lines of the encoders.
    noise: &'static [&'static str],
}

/// On both encoders, each of which is then off for the rest of a tick after as many edges as the program allows.
const TONES: [&[&str]; 3] = [
    &["tone=12500,1,1", "tone=12630,2,1"],
    &["tone=20000,1,1", "tone=20000,2,1"],
    &["tone=21300,1,1", "tone=21430,2,1"],
];
/// On both lines of both encoders, at each edge of either motor's PWM.
const PWM_SPIKES: [&[&str]; 2] = [&["pwm-spikes=2,1"], &["pwm-spikes=20,1"]];

const SETTINGS: Settings = Settings { board_id: 5, ..Settings::DEFAULT };
const OTHERS: Settings = Settings { board_id: 6, counts_per_turn: 1204.0, gyro_bias: [3.25, -7.5, 1.125], ..SETTINGS };
const WRITES: &[Command] =
    &[Command::WriteSettings(SETTINGS), Command::SaveSettings, Command::WriteSettings(OTHERS), Command::SaveSettings];

impl Load {
    const fn new(name: &'static str, requests: &'static [Command], share: f64) -> Self {
        Self { name, requests, share, turning: true, noise: &[] }
    }

    /// Bears it for two seconds. Returns the host, and how many requests were sent and answered.
    fn bear(&self) -> (Host, u64, u64) {
        let mut host = Host::ready(BoardOptions::default());
        if self.turning {
            host.set_speeds([90.0, -60.0]);
        }
        host.run_linked_ms(500);
        self.noise.iter().for_each(|fault| host.inject(fault));
        host.board.rig_mut().marks.clear();
        let late = host.board.mcu.serial_overruns();
        let mut requests = self.requests.iter().cycle();
        let (mut sent, mut owed) = (0, 0.0);
        let answered = host.replies();
        for _ in 0..2000 {
            owed += 50.0 * self.share;
            while owed >= 6.0 {
                let waiting = host.board.rig().serial.waiting();
                host.send(*requests.next().unwrap());
                owed -= (host.board.rig().serial.waiting() - waiting) as f64;
                sent += 1;
            }
            host.run_ms(1);
        }
        host.run_ms(10);
        let answered = host.replies() - answered;
        assert_eq!(host.board.mcu.serial_overruns(), late, "{}: the program read bytes too late", self.name);
        (host, sent, answered)
    }
}

#[test]
fn no_load_of_the_line_takes_anything_from_motors_and_telemetry() {
    const PINGS: &[Command] = &[Command::Ping];
    const READS: &[Command] = &[Command::ReadSettings];
    const HELLO: &[Command] = &[Command::Hello];
    let loads = [
        Load::new("pings", PINGS, 0.0163),
        Load::new("pings", PINGS, 0.028),
        Load::new("pings", PINGS, 0.2),
        Load::new("pings", PINGS, 0.5),
        Load::new("pings", PINGS, 1.0),
        Load::new("handshakes", HELLO, 1.0),
        Load::new("settings read", READS, 0.01),
        Load::new("settings read", READS, 1.0),
        Load::new("fault log read", &[Command::ReadFault { index: 7 }], 1.0),
        Load { turning: false, ..Load::new("settings written and saved", WRITES, 1.0) },
        Load { turning: false, noise: TONES[1], ..Load::new("the same with noisy encoders", WRITES, 1.0) },
        Load { noise: PWM_SPIKES[0], ..Load::new("settings read with PWM spikes of 2 us", READS, 1.0) },
        Load { noise: PWM_SPIKES[1], ..Load::new("settings read with PWM spikes of 20 us", READS, 1.0) },
        Load { noise: PWM_SPIKES[1], ..Load::new("pings with PWM spikes of 20 us", PINGS, 0.01) },
        Load { turning: false, noise: TONES[0], ..Load::new("handshakes with noise of 12.5 kHz", HELLO, 1.0) },
        Load { turning: false, noise: TONES[1], ..Load::new("handshakes with noise of 20 kHz", HELLO, 1.0) },
        Load { turning: false, noise: TONES[2], ..Load::new("handshakes with noise of 21.3 kHz", HELLO, 1.0) },
    ];
    println!("| load | of the line | requests | answered | worst tick, cycles | telemetry lost |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: |");
    for load in loads {
        let (host, sent, answered) = load.bear();
        let tick = host.board.rig().marks.tick;
        let last = host.last();
        let Load { name, share, noise, .. } = load;
        println!("| {name} | {:.0} % | {sent} | {answered} | {} | {} |", 100.0 * share, tick.worst, last.unsent.0);
        let stops = TONES.contains(&noise);
        assert_eq!((last.fault != Fault::None, last.missed_ticks.0, last.unsent.0), (stops, 0, 0), "{name}");
        // What the processor has no time for is dropped; a host sends far less.
        assert!(answered > 0 && (answered == sent || share > 0.1), "{answered} of {sent}");
        let ram = u64::from(host.board.static_bytes.unwrap() + host.board.deepest_stack().unwrap());
        assert!(ram <= RAM, "{name}: {ram} bytes of RAM");
        assert!(tick.worst <= WORST_TICK, "{name}: {} cycles", tick.worst);
    }
}

/// Where long wires make the sensor's bus slow, a tick takes longer than [`WORST_TICK`] under such loads. Nothing is lost by that: the
/// next tick still begins in time.
#[test]
fn a_slow_bus_under_any_load_of_the_line_misses_no_tick() {
    for noise in [&["bus-rise=4"][..], &["bus-rise=4", "pwm-spikes=20,1"], &["bus-rise=4", "pwm-spikes=55,1"]] {
        let load = Load { noise, ..Load::new("settings read", &[Command::ReadSettings], 1.0) };
        assert_eq!(fault_without_a_missed_tick(&load), Fault::None, "{noise:?}");
    }
}

/// A tone of some kHz makes more edges than any motor. Until it is a fault, a tick may take longer than [`WORST_TICK`] beside a full
/// line, but none is missed.
#[test]
fn a_tone_on_both_encoders_misses_no_tick_until_it_is_a_fault() {
    for noise in [
        &["tone=3000,1,1", "tone=3030,2,1"],
        &["tone=7000,1,1", "tone=7070,2,1"],
        &["tone=11000,1,1", "tone=11110,2,1"],
    ] {
        let load = Load { noise, ..Load::new("handshakes", &[Command::Hello], 1.0) };
        let fault = fault_without_a_missed_tick(&load);
        let is_named = matches!(
            fault,
            Fault::Encoder1Noisy | Fault::Encoder2Noisy | Fault::Encoder1Failed | Fault::Encoder2Failed
        );
        assert!(is_named, "{noise:?}: {fault:?}");
    }
}

/// Bears a load that may take more than [`WORST_TICK`]. Returns the fault that it ends in.
fn fault_without_a_missed_tick(load: &Load) -> Fault {
    let (host, sent, answered) = load.bear();
    let (worst, last) = (host.board.rig().marks.tick.worst, host.last());
    let what = format!("{} with {}", load.name, load.noise.join(", "));
    println!("| {what} | 100 % | {sent} | {answered} | {worst} | {} |", last.unsent.0);
    assert_eq!((last.missed_ticks.0, last.unsent.0), (0, 0), "{what}");
    assert!(worst < TICK && answered > 0, "{what}: {worst} cycles, {answered} answers");
    last.fault
}
