//! The effect of each fault on the board.

use crate::board::Board;
use crate::encoder::Disturbance;
use crate::fault::{BANDGAP_MV, Fault, SUPPLY_MV};
use crate::motor::Rotor;

/// The supply in a brown-out, mV.
const BROWN_OUT_MV: u32 = 2000;

/// Frames a second of a full stream, one in each tick of the board.
const STREAM_HZ: f64 = 200.0;

impl Board {
    /// Makes a fault begin now.
    pub fn inject(&mut self, fault: Fault) {
        match fault {
            Fault::EncoderSwapped { motor } => self.rig_mut().encoders[motor].swapped = true,
            Fault::Disturbed { motor, channel, disturbance } => self.disturb_encoder(motor, channel, disturbance),
            Fault::Coupled(cable) => self.lay_cable(Some(cable)),
            Fault::UnevenPoles { motor, fraction } => self.rig_mut().encoders[motor].uneven = fraction,
            Fault::Held { motor, rotor } => self.rig_mut().motors[motor].hold(rotor),
            Fault::Stiction { motor, fraction } => self.rig_mut().motors[motor].parameters.breakaway = fraction,
            Fault::MotorReversed { motor } => self.rig_mut().motors[motor].reversed = true,
            Fault::MotorOff { motor } => self.rig_mut().motors[motor].powered = false,
            Fault::MotorsSwapped => self.swap_motors(true),
            Fault::MotorSupplyOff => self.rig_mut().motors.iter_mut().for_each(|motor| motor.powered = false),
            Fault::MotorSupply { volts } => self.rig_mut().supply.forced_v = Some(volts),
            Fault::Imu(fault) => self.change_imu(|imu| imu.inject(fault)),
            Fault::Register { address, value } => self.change_imu(|imu| imu.set_register_behind(address, value)),
            Fault::SensorClock { fraction } => self.change_imu(|imu| imu.oscillator_error = fraction),
            Fault::Scale { fraction } => self.change_imu(|imu| imu.source.part.scale = fraction),
            Fault::Askew { fraction } => self.change_imu(|imu| imu.source.part.askew = fraction),
            Fault::Spin { dps } => self.change_imu(|imu| imu.source.spin_dps = dps),
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
            Fault::FramesLost { share } => self.rig_mut().serial.lost = share,
            Fault::NoFrames { ms } => self.rig_mut().serial.drop_frames((ms * 1e-3 * STREAM_HZ).round() as u64),
            Fault::Push { axis, degrees } => {
                if let Some(plant) = self.plant_mut() {
                    plant.push(axis, degrees.to_radians());
                }
            }
            Fault::Usb { latency_ms, packet } => self.rig_mut().serial.usb.set_packets(packet, latency_ms * 1e-3),
        }
    }

    /// Returns why a fault cannot happen to this board.
    pub fn refuses(&self, fault: &Fault) -> Option<&'static str> {
        let needs_robot = matches!(fault, Fault::Push { .. });
        let needs_encoder = matches!(
            fault,
            Fault::EncoderSwapped { .. } | Fault::Disturbed { .. } | Fault::Coupled(_) | Fault::UnevenPoles { .. }
        );
        if needs_robot && self.plant().is_none() {
            return Some("there is no robot to push; start with --robot FILE.toml or --robot published");
        }
        (needs_encoder && !self.rig().kind.has_encoders)
            .then_some("this rig has no encoders; start with --rig encoders or --rig in-in")
    }

    /// Ends every fault that can end. Its effects on registers and on the program stay.
    pub(crate) fn end_faults(&mut self) {
        for motor in 0..2 {
            self.rig_mut().encoders[motor].swapped = false;
            self.rig_mut().encoders[motor].uneven = 0.0;
            (0..2).for_each(|channel| self.disturb_encoder(motor, channel, Disturbance::None));
            let breakaway = self.rig().kind.motors[motor].breakaway;
            let motor = &mut self.rig_mut().motors[motor];
            motor.hold(Rotor::Free);
            motor.parameters.breakaway = breakaway;
            motor.reversed = false;
            motor.powered = true;
        }
        self.rig_mut().supply.forced_v = None;
        self.swap_motors(false);
        self.lay_cable(None);
        self.change_imu(|imu| {
            imu.clear_faults();
            let error = imu.source.part.errors.sample_clock_error;
            imu.oscillator_error = error;
            imu.source.spin_dps = 0.0;
            let part = &mut imu.source.part;
            (part.scale, part.askew) = (0.0, 0.0);
        });
        self.set_bus_rise_us(0.0);
        self.set_supply_mv(SUPPLY_MV);
        self.set_bandgap_mv(BANDGAP_MV);
        self.set_resonator_error(self.rig().imu.source.part.errors.board_clock_error);
        self.rig_mut().serial.usb.set_packets(0, 0.0);
        self.rig_mut().serial.lost = 0.0;
    }
}
