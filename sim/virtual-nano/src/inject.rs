//! The start and the end of faults on the board.

use crate::board::{BANDGAP_MV, Board, SUPPLY_MV};
use crate::encoder::Disturbance;
use crate::fault::Fault;
use crate::motor::Rotor;

impl Board {
    /// Begins a fault now.
    pub fn inject(&mut self, fault: Fault) {
        fault.begin(self);
    }

    /// Begins a fault at a time (s) since power came up.
    pub fn inject_at(&mut self, at_s: f64, fault: Fault) {
        self.later(at_s, move |board| board.inject(fault));
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
        self.rig_mut().shaking_dps = 0.0;
        self.swap_motors(false);
        self.rig_mut().coupling.cable = None;
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
