//! Controllers: where they aim, what they press, and where they walk.

use glam::Vec3;
use shadecast_client::Input;
use shadecast_simulated_runtime::sys::Vector2f;
use shadecast_simulated_runtime::{Controller, Script};

use crate::rig::{Rig, still_head};

#[test]
#[ignore = "needs a Vulkan driver"]
fn presses_are_counted_and_sticks_walk() {
    let mut rig = Rig::at_the_wall(Script {
        controllers: [None, Some(Controller::AT_REST)],
        head: still_head(),
        ..Script::default()
    });
    rig.run_to(10);
    let before = rig.headset.world_from_play();
    assert_eq!(before.position, Vec3::ZERO);
    let press = |rig: &Rig, pressed: bool| {
        rig.runtime.rewrite(|script| {
            script.controllers[1] = Some(Controller {
                pressed,
                ..Controller::AT_REST
            });
        });
    };
    for presses in 1..=3 {
        press(&rig, true);
        rig.run_to(10 + presses * 6 - 3);
        press(&rig, false);
        rig.run_to(10 + presses * 6);
    }
    let last = *rig.views().last().expect("views are reported");
    let [left, right] = last.hands;
    assert_eq!(left, None, "nobody holds the left one");
    let right = right.expect("the right one is held");
    assert_eq!((right.pressed, right.presses), (false, 3));
    let aim = Vec3::new(0.2, 1.0, -0.3);
    assert!((right.world_from_aim.position - aim).length() < 1e-5);

    // Straight ahead for 45 frames, half a second.
    rig.runtime.rewrite(|script| {
        let stick = Vector2f { x: 0.0, y: 1.0 };
        script.controllers[1] = Some(Controller {
            stick,
            ..Controller::AT_REST
        });
    });
    let start = rig.runtime.waited();
    rig.run_to(start + 45);
    let walked = rig.headset.world_from_play().position;
    assert!((walked - Vec3::NEG_Z * 0.75).length() < 0.03, "{walked}");
    let last = *rig.views().last().expect("views are reported");
    assert!((last.linear_velocity - Vec3::NEG_Z * 1.5).length() < 1e-3);
    let aim = last.hands[1].expect("the right one is held").world_from_aim;
    assert!(
        (aim.position.z + 0.3 + 0.75).abs() < 0.05,
        "hands walk with the head"
    );
    assert_eq!(rig.runtime.log().broken_rules(), []);
    assert!(
        rig.told
            .iter()
            .any(|input| matches!(input, Input::Drawn(_)))
    );
}
