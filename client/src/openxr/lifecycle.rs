//! The life of a session with a runtime, apart from the runtime itself.
//!
//! ```text
//!  Idle --> Ready ==begin==> Synchronized <-> Visible <-> Focused
//!    ^                            |
//!    +------end== Stopping <------+        Exiting, LossPending: leave
//! ```
//!
//! Source: OpenXR 1.0, section 9.3, "Session lifecycle".

use ::openxr as xr;
use xr::SessionState as S;

/// What a new state asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing.
    Stay,
    /// Begin the session: frames are wanted from now on.
    Begin,
    /// End the session: the headset was taken off, or another application is
    /// shown. It may begin again.
    End,
    /// Destroy the session.
    Leave(Ending),
}

/// How a session ends for good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The user left.
    Exit,
    /// The runtime or the headset went away and may come back.
    Lost,
}

/// Where a session is in its life.
#[derive(Clone, Copy, Debug)]
pub struct LifeCycle {
    state: S,
    running: bool,
}

impl Default for LifeCycle {
    fn default() -> Self {
        Self {
            state: S::IDLE,
            running: false,
        }
    }
}

impl LifeCycle {
    /// Takes a state that the runtime announced. A state that is out of turn
    /// (a second ready, a stopping that never began) asks for nothing.
    pub fn enter(&mut self, state: S) -> Step {
        self.state = state;
        match state {
            S::READY if !self.running => {
                self.running = true;
                Step::Begin
            }
            S::STOPPING if self.running => {
                self.running = false;
                Step::End
            }
            S::EXITING => self.leave(Ending::Exit),
            S::LOSS_PENDING => self.leave(Ending::Lost),
            _ => Step::Stay,
        }
    }

    fn leave(&mut self, ending: Ending) -> Step {
        self.running = false;
        Step::Leave(ending)
    }

    /// Whether frames are waited for, begun and ended.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.running
    }

    /// Whether controllers tell what they do.
    #[must_use]
    pub fn is_focused(&self) -> bool {
        self.state == S::FOCUSED
    }

    /// The newest state.
    #[must_use]
    pub fn state(&self) -> S {
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The steps of a life through these states.
    fn steps(states: &[S]) -> Vec<Step> {
        let mut life = LifeCycle::default();
        states.iter().map(|state| life.enter(*state)).collect()
    }

    #[test]
    fn a_headset_is_put_on_taken_off_and_put_on_again() {
        let mut life = LifeCycle::default();
        for _ in 0..3 {
            assert_eq!(life.enter(S::READY), Step::Begin);
            assert!(life.is_running() && !life.is_focused());
            for state in [S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED] {
                assert_eq!(life.enter(state), Step::Stay);
            }
            assert!(life.is_focused());
            for state in [S::VISIBLE, S::SYNCHRONIZED] {
                assert_eq!(life.enter(state), Step::Stay);
                assert!(life.is_running() && !life.is_focused());
            }
            assert_eq!(life.enter(S::STOPPING), Step::End);
            assert_eq!(life.enter(S::IDLE), Step::Stay);
            assert!(!life.is_running());
        }
        assert_eq!(life.enter(S::EXITING), Step::Leave(Ending::Exit));
    }

    #[test]
    fn a_loss_ends_it_in_any_state() {
        for state in [S::IDLE, S::READY, S::VISIBLE, S::FOCUSED, S::STOPPING] {
            let mut life = LifeCycle::default();
            life.enter(state);
            assert_eq!(life.enter(S::LOSS_PENDING), Step::Leave(Ending::Lost));
            assert!(!life.is_running());
        }
    }

    #[test]
    fn states_out_of_turn_ask_for_nothing() {
        assert_eq!(steps(&[S::READY, S::READY]), [Step::Begin, Step::Stay]);
        assert_eq!(steps(&[S::STOPPING]), [Step::Stay]);
        assert_eq!(steps(&[S::FOCUSED, S::from_raw(99)]), [Step::Stay; 2]);
    }
}
