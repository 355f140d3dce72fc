// Millimetres (high, low byte); blue: 1 well inside the mask, 0 at its edge and outside.
uniform highp sampler2D frame_depth;

// Weight of the shown frame's own colour, 0 to 1: depth agreement (1 within 0.05 m of the expected depth, 0 from 0.09 m
// on, as frame_layer.c) times visibility. s: frame_sample as avatar.vert has it.
float depth_agreement(vec4 s)
{
    vec4 depth = texture(frame_depth, s.xy);
    float agreement = clamp((0.09 - abs(dot(depth.rg, vec2(65.28, 0.255)) - s.z)) * 25.0, 0.0, 1.0);
    return s.w * depth.b * agreement * agreement * (3.0 - 2.0 * agreement);
}
