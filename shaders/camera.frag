#version 300 es
// A camera image in its own memory layout, converted to RGB by the integer arithmetic of base/pixels.c, bit for bit.
precision highp float;
precision highp int;
uniform highp sampler2D first_plane;  // YUYV, UYVY: two pixels a texel; NV12: luma; RGBX, BGRX: a pixel
uniform highp sampler2D chroma_plane; // NV12: Cb Cr; else any
uniform vec4 arrangement; // x: enum dmabuf_layout
uniform vec4 coefficients[2]; // struct yuv_coefficients: y r_cr g_cb g_cr, b_cb y_zero
out vec4 color;

ivec4 bytes(highp sampler2D plane, ivec2 at)
{
    return ivec4(texelFetch(plane, at, 0) * 255.0 + 0.5);
}

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    int layout_is = int(arrangement.x);
    if (layout_is >= 3) {
        vec4 here = texelFetch(first_plane, at, 0);
        color = vec4(layout_is == 3 ? here.rgb : here.bgr, 1.0);
        return;
    }
    ivec3 yuv;
    if (layout_is == 2) {
        yuv = ivec3(bytes(first_plane, at).r, bytes(chroma_plane, at / 2).rg);
    } else {
        ivec4 pair = bytes(first_plane, ivec2(at.x / 2, at.y));
        pair = layout_is == 0 ? pair : pair.yxwz; // UYVY: Cb Y0 Cr Y1
        yuv = ivec3(at.x % 2 == 0 ? pair.x : pair.z, pair.yw);
    }
    ivec4 k = ivec4(coefficients[0]);
    int y = k.x * (yuv.x - int(coefficients[1].y)), cb = yuv.y - 128, cr = yuv.z - 128;
    ivec3 rgb = ivec3(y + k.y * cr, y - k.z * cb - k.w * cr, y + int(coefficients[1].x) * cb);
    color = vec4(vec3(clamp((rgb + 32768) >> 16, 0, 255)) / 255.0, 1.0);
}
