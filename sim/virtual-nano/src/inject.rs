//! The effect of each fault on the board.

use crate::board::Board;
use crate::encoder::Disturbance;
use crate::fault::{BANDGAP_MV, Fault, SUPPLY_MV};
use crate::motor::{MotorParameters, NOMINAL_V, Rotor};

/// The supply in a brown-out, mV.
const BROWN_OUT_MV: u32 = 2000;

/// Frames a second of a full stream, one in each tick of the board.
const STREAM_HZ: f64 = 200.0;

impl Board {
    /// Makes a fault begin now.
    pub fn inject(&mut self, fault: Fault) {
        match fault {
            Fault::EncoderSwapped { motor } => self.encoder_mut(motor).swap(true),
            Fault::Disturbed { motor, channel, disturbance } => self.disturb_encoder(motor, channel, disturbance),
            Fault::Coupled(cable) => self.lay_cable(Some(cable)),
            Fault::UnevenPoles { motor, fraction } => self.encoder_mut(motor).set_uneven(fraction),
            Fault::Held { motor, rotor } => self.motors_mut()[motor].hold(rotor),
            Fault::Stiction { motor, fraction } => self.motors_mut()[motor].parameters_mut().breakaway = fraction,
            Fault::MotorReversed { motor } => self.motors_mut()[motor].reverse(true),
            Fault::MotorsSwapped => self.swap_motors(true),
            Fault::MotorSupplyOff => self.motors_mut().iter_mut().for_each(|motor| motor.set_powered(false)),
            Fault::MotorSupply { volts } => self.motors_mut().iter_mut().for_each(|motor| motor.set_supply(volts)),
            Fault::Imu(fault) => self.change_imu(|imu| imu.inject(fault)),
            Fault::Register { address, value } => self.change_imu(|imu| imu.set_register_behind(address, value)),
            Fault::SensorClock { fraction } => self.change_imu(|imu| imu.set_oscillator_error(fraction)),
            Fault::Scale { fraction } => self.change_imu(|imu| imu.source_mut().part_mut().scale = fraction),
            Fault::Askew { fraction } => self.change_imu(|imu| imu.source_mut().part_mut().askew = fraction),
            Fault::Spin { dps } => self.change_imu(|imu| imu.source_mut().spin(dps)),
            Fault::BusRise { us } => self.set_bus_rise_us(us),
            Fault::Supply { mv } => self.set_supply_mv(mv),
            Fault::BrownOut { ms } => {
                self.set_supply_mv(BROWN_OUT_MV);
                let back_s = self.seconds() + ms * 1e-3;
                self.inject_at(back_s, Fault::Supply { mv: SUPPLY_MV });
            }
            Fault::Bandgap { mv } => self.set_bandgap_mv(mv),
            Fault::Resonator { fraction } => self.set_resonator_error(fraction),
            Fault::Hang { interrupts } => self.hang(interrupts),
            Fault::Busy { ms } => self.keep_busy_ms(ms),
            Fault::FramesLost { share } => self.serial_mut().lose_frames(share),
            Fault::NoFrames { ms } => self.serial_mut().drop_frames((ms * 1e-3 * STREAM_HZ).round() as u64),
            Fault::Push { axis, degrees } => {
                if let Some(plant) = self.plant_mut() {
                    plant.push(axis, degrees.to_radians());
                }
            }
            Fault::Usb { latency_ms, packet } => self.serial_mut().usb_mut().set_packets(packet, latency_ms * 1e-3),
        }
    }

    /// Returns why a fault cannot happen to this board.
    pub fn refuses(&self, fault: &Fault) -> Option<&'static str> {
        let needs_robot = matches!(fault, Fault::Push { .. });
        (needs_robot && self.plant().is_none())
            .then_some("there is no robot to push; start with --robot FILE.toml or --robot published")
    }

    /// Ends every fault that can end. Its effects on registers and on the program stay.
    pub(crate) fn end_faults(&mut self) {
        for motor in 0..2 {
            self.encoder_mut(motor).swap(false);
            self.encoder_mut(motor).set_uneven(0.0);
            (0..2).for_each(|channel| self.disturb_encoder(motor, channel, Disturbance::None));
            let motor = &mut self.motors_mut()[motor];
            motor.hold(Rotor::Free);
            motor.parameters_mut().breakaway = MotorParameters::default().breakaway;
            motor.reverse(false);
            motor.set_powered(true);
            motor.set_supply(NOMINAL_V);
        }
        self.swap_motors(false);
        self.lay_cable(None);
        self.change_imu(|imu| {
            imu.clear_faults();
            let error = imu.source().part().errors().sample_clock_error;
            imu.set_oscillator_error(error);
            imu.source_mut().spin(0.0);
            let part = imu.source_mut().part_mut();
            (part.scale, part.askew) = (0.0, 0.0);
        });
        self.set_bus_rise_us(0.0);
        self.set_supply_mv(SUPPLY_MV);
        self.set_bandgap_mv(BANDGAP_MV);
        self.set_resonator_error(self.imu().source().part().errors().board_clock_error);
        self.serial_mut().usb_mut().set_packets(0, 0.0);
        self.serial_mut().lose_frames(0.0);
    }
}
