//! The cases of `shadecast-eval stress`, with few samples.

use shadecast_eval::stress;

macro_rules! cases {
    ($($(#[$attribute:meta])* $name:ident;)*) => {
        $(
            #[test]
            $(#[$attribute])*
            fn $name() {
                if let Err(broken) = stress::check(stringify!($name)) {
                    panic!("{broken}");
                }
            }
        )*

        #[test]
        fn every_case_is_a_test() {
            let tested = [$(stringify!($name)),*];
            assert_eq!(stress::names().collect::<Vec<_>>(), tested);
        }
    };
}

cases! {
    #[ignore = "needs a Vulkan driver"]
    white_room;
    #[ignore = "needs a Vulkan driver"]
    furnace;
    #[ignore = "needs a Vulkan driver"]
    grazing_light;
    #[ignore = "needs a Vulkan driver"]
    grazing_eye;
    #[ignore = "needs a Vulkan driver"]
    mirror_room;
    #[ignore = "needs a Vulkan driver"]
    black_walls;
    #[ignore = "needs a Vulkan driver"]
    glaring_square;
    #[ignore = "needs a Vulkan driver"]
    glaring_ball;
    #[ignore = "needs a Vulkan driver"]
    thousands_of_lamps;
    #[ignore = "needs a Vulkan driver"]
    lamp_in_a_box;
    #[ignore = "needs a Vulkan driver"]
    size_and_place;
    #[ignore = "needs a Vulkan driver"]
    slivers_and_doubles;
    #[ignore = "needs a Vulkan driver"]
    walls_in_one_place;
    #[ignore = "needs a Vulkan driver"]
    eye_on_a_surface;
    #[ignore = "needs a Vulkan driver"]
    texture_of_one_texel;
    #[ignore = "needs a Vulkan driver"]
    texture_of_64_million_texels;
    #[ignore = "needs a Vulkan driver"]
    huge_texture_coordinates;
    #[ignore = "needs a Vulkan driver"]
    glaring_pixel;
    #[ignore = "needs a Vulkan driver"]
    one_pixel;
    pixels_that_are_no_number;
    halves;
    displayed_extremes;
    #[ignore = "needs a Vulkan driver"]
    video_of_extremes;
    #[ignore = "needs a Vulkan driver"]
    light_of_extremes;
    files_with_wrong_numbers;
    #[ignore = "needs a Vulkan driver"]
    file_that_creates_light;
    #[ignore = "needs a Vulkan driver"]
    constant_light;
    #[ignore = "needs a Vulkan driver"]
    zero_variance;
    #[ignore = "needs a Vulkan driver"]
    lamp_in_a_mirror;
    #[ignore = "needs a Vulkan driver"]
    alternating_light;
    #[ignore = "needs a Vulkan driver"]
    leaping_shadow;
    #[ignore = "needs a Vulkan driver"]
    uneven_time;
    #[ignore = "needs a Vulkan driver"]
    distant_time;
    #[ignore = "needs a Vulkan driver"]
    leaping_head;
    #[ignore = "needs a Vulkan driver"]
    head_on_a_surface;
}
