// How much of a pixel a capsule covers, and how light it is there.
//
// Nothing is interpolated: interpolated values depend on which other triangles are drawn. Only additions and
// multiplications, which every machine rounds alike; `precise` keeps them from being fused. The distance to the edge is
// (r^2 - d^2) / 2r, which is the true one near the edge, without a square root.
flat in vec4 f_line;
flat in vec4 f_body;
flat in vec4 f_colour;
flat in vec4 f_extra;
#ifndef CHROMA
flat in vec4 f_part_line;
flat in vec4 f_part_body;
#endif

out vec4 painted;

void main() {
#ifdef CHROMA
    // A chroma sample stands for two by two pixels; it lies on the left one's centre, midway between the rows.
    vec2 pixel = gl_FragCoord.xy * 2.0 - vec2(0.5, 0.0) - f_extra.xy;
#else
    vec2 pixel = gl_FragCoord.xy - f_extra.xy;
#endif
    PRECISE vec2 from_start = pixel - f_line.xy;
    from_start.y *= f_extra.w;
    PRECISE float on_line = (from_start.x * f_line.z + from_start.y * f_line.w) * f_body.z;
    PRECISE float share = clamp(on_line, 0.0, 1.0);
    PRECISE vec2 out_of_axis = from_start - f_line.zw * share;
    PRECISE float radius = f_body.x + f_body.y * share;
    PRECISE float distance2 = out_of_axis.x * out_of_axis.x + out_of_axis.y * out_of_axis.y;
    // 1 / 2r where the capsule has this radius: one step of Newton's from that of its mean radius. Soft shapes, which are
    // stretched, bring their own steepness.
    PRECISE float nearer = f_body.w * (2.0 - 2.0 * radius * f_body.w);
    float steep = f_extra.w > 1.0 ? f_body.w : nearer;
    PRECISE float inside = (radius * radius - distance2) * steep;
#ifdef CHROMA
    float cover = clamp(inside * 0.5 + 0.5, 0.0, 1.0) * f_colour.w;
    painted = vec4(f_colour.yz, 0.0, cover);
#else
    float cover = clamp(inside + 0.5, 0.0, 1.0) * f_colour.w;
    // A soft light from above left: brighter where the surface faces it, darker towards the rim. It falls on the part that
    // the capsule belongs to, so that what a part is put together from is not seen. Past a joint the surface counts as
    // going straight on, so that two bones meet without a seam; a free end is round.
    PRECISE vec2 from_part = pixel - f_part_line.xy;
    PRECISE float on_part = (from_part.x * f_part_line.z + from_part.y * f_part_line.w) * f_part_body.z;
    PRECISE float part_share = clamp(on_part, 0.0, 1.0);
    PRECISE float part_radius = f_part_body.x + f_part_body.y * part_share;
    float round_end = on_part > 0.5 ? step(1.5, f_extra.z) : step(2.5, f_extra.z);
    PRECISE vec2 straight_on = from_part - f_part_line.zw * on_part;
    PRECISE vec2 round_about = from_part - f_part_line.zw * part_share;
    vec2 side = round_end > 0.5 ? round_about : straight_on;
    PRECISE float across = f_part_body.w * (4.0 - 4.0 * part_radius * f_part_body.w);
    PRECISE float slope = (side.x * LIGHT_X + side.y * LIGHT_Y) * across;
    PRECISE float rim = min((side.x * side.x + side.y * side.y) * across * across, 1.3);
    PRECISE float light = 1.0 + min(f_extra.z, 1.0) * (LIGHT_BASE + slope - rim * LIGHT_RIM);
    PRECISE float luma = (f_colour.x - BLACK) * light;
#ifdef RGB
    // BT.709, limited range; the same colours as in a video.
    vec2 chroma = (f_colour.yz - 128.0 / 255.0) * (255.0 / 224.0);
    float grey = luma * (255.0 / 219.0);
    vec3 rgb = vec3(grey + 1.5748 * chroma.y, grey - 0.187324 * chroma.x - 0.468124 * chroma.y, grey + 1.8556 * chroma.x);
    painted = vec4(clamp(rgb, 0.0, 1.0), cover);
#else
    painted = vec4(luma + BLACK, 0.0, 0.0, cover);
#endif
#endif
}
