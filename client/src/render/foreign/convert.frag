// A picture of the platform's decoder as RGBA, texel by texel.
// Compiled by compile.sh; the binary holds this text, and a test compares them.
//
// GLSL, because WGSL has no combined sampler, and only one that is combined and
// immutable may convert YCbCr. That conversion is the sampler's: this shader is
// the same for a source that is RGBA already. Fetches are not allowed with it,
// hence coordinates and a filter of the nearest. They lie a quarter of a texel
// before the centre: at the centre of an odd texel, chroma that is sited with the
// even ones is as near as the next block's.
#version 450

layout(set = 0, binding = 0) uniform sampler2D picture;

layout(push_constant) uniform Source {
    // 1 / size of the buffer, which may be larger than the picture in it.
    vec2 texel;
};

layout(location = 0) out vec4 color;

void main() {
    color = vec4(textureLod(picture, (gl_FragCoord.xy - 0.25) * texel, 0.0).rgb, 1.0);
}
