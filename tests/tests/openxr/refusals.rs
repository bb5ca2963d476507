//! Headsets that cannot be used: each ends with one sentence that says why.

use shadecast_client::openxr::HeadsetError;
use shadecast_simulated_runtime::sys::Version;
use shadecast_simulated_runtime::{Headset, Script};

use crate::rig::Rig;

/// What is said of a headset like this.
#[track_caller]
fn refusal(change: impl FnOnce(&mut Headset)) -> String {
    let mut script = Script::default();
    change(&mut script.headset);
    match Rig::open(script) {
        Ok(_) => panic!("it was opened"),
        Err(error) => sentence(&error),
    }
}

fn sentence(error: &HeadsetError) -> String {
    let said = error.to_string();
    assert!(!said.contains('\n') && said.len() > 20, "{said}");
    said
}

#[test]
fn a_runtime_that_cannot_serve_is_named_before_any_device_is_made() {
    let said = refusal(|it| it.extensions.retain(|name| *name != "KHR_vulkan_enable2"));
    assert!(said.contains("does not draw with Vulkan"), "{said}");
    let said = refusal(|it| it.speaks_1_0 = false);
    assert!(said.contains("OpenXR 1.0"), "{said}");
    let said = refusal(|it| it.oldest_vulkan = Version::new(1, 4, 0));
    assert!(said.contains("Vulkan 1.4 or newer"), "{said}");
    let said = refusal(|it| it.connected = false);
    assert!(said.contains("no headset is connected"), "{said}");
    for views in [0, 1, 4] {
        let said = refusal(|it| it.eyes.count = views);
        assert!(said.contains(&format!("{views} views")), "{said}");
    }
    for size in [[0, 256], [256, 100_000]] {
        let said = refusal(|it| it.eyes.size = size);
        assert!(said.contains("not possible"), "{said}");
    }
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_device_that_lacks_an_extension_is_named() {
    let said =
        refusal(|it| it.vulkan_device = ash::vk::Result::ERROR_EXTENSION_NOT_PRESENT.as_raw());
    assert!(
        said.starts_with("the GPU driver gave no Vulkan device: ") && said.contains("xtension"),
        "{said}"
    );
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_runtime_that_refuses_what_it_offers_is_asked_for_less() {
    let mut script = Script::default();
    script.headset.refuses = vec!["KHR_composition_layer_depth"];
    let mut rig = Rig::at_the_wall(script);
    rig.run_to(8);
    let log = rig.runtime.log();
    assert_eq!(log.extensions, ["KHR_vulkan_enable2"]);
    assert_eq!(
        log.broken_rules(),
        [(
            "xrCreateInstance",
            shadecast_simulated_runtime::sys::Result::ERROR_EXTENSION_NOT_PRESENT
        )]
    );
    assert_eq!(log.frames[7].layers.len(), 1, "and shows the world");

    // What cannot be done without ends with a sentence.
    let said = refusal(|it| it.refuses = vec!["KHR_vulkan_enable2"]);
    assert!(said.contains("gave no instance"), "{said}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn pictures_that_the_runtime_does_not_take_are_named() {
    // R8G8B8A8_UNORM and D32_SFLOAT.
    let said = refusal(|it| it.formats = vec![37, 126]);
    assert!(
        said.contains("8-bit sRGB") && said.contains("[37, 126]"),
        "{said}"
    );
    let said = refusal(|it| it.formats.clear());
    assert!(said.contains("[]"), "{said}");
}

#[test]
#[ignore = "needs a Vulkan driver"]
fn a_runtime_that_takes_blue_first_or_no_depth_is_served() {
    let mut script = Script::default();
    script.headset.formats = vec![44, 50];
    let mut rig = Rig::at_the_wall(script);
    rig.run_to(8);
    let log = rig.runtime.log();
    assert_eq!(log.swapchains, [(50, crate::rig::SMALL, crate::rig::SMALL)]);
    assert_eq!(log.broken_rules(), []);
    assert!(!rig.headset.offers().expect("a session").depth);
}
