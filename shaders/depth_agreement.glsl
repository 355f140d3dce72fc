uniform highp sampler2D frame_depth; // millimetres (high, low byte); blue: 0 at the person's edge and elsewhere,
                                   // 1 well within

// How much of a place is the shown frame's own: whether its depth there bears out where the place should be, all of it
// within 0.05 m, nothing from 0.09 m on (triangle_visibility.c). seen: as avatar.vert has it.
float depth_agreement(vec4 seen)
{
    vec4 there = texture(frame_depth, seen.xy);
    float agreement = clamp((0.09 - abs(dot(there.rg, vec2(65.28, 0.255)) - seen.z)) * 25.0, 0.0, 1.0);
    return seen.w * there.b * agreement * agreement * (3.0 - 2.0 * agreement);
}
