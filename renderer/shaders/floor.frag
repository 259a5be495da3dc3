// The floor as `floor.Floor.rgb` computes it, for a window, which has no time to wait for that while a camera moves.
uniform vec3 eye;         // metres
uniform vec3 right;       // where the camera looks: to the right, up and towards the eye
uniform vec3 above;
uniform vec3 back;
uniform vec2 middle;      // of the frame, pixels
uniform float focal;      // pixels
uniform float floor_m;    // its height
uniform float half_faded; // metres from the eye
uniform vec3 edges;       // how far from sides, top and bottom of the frame it fades, pixels
uniform vec2 shift;       // how far the camera has come, metres
uniform vec3 ground;      // luma and chromas of the background, 0..1 of the 8-bit range
uniform float half_width; // of a line, metres
uniform vec2 shades;      // of the floor and of the grid on it

out vec4 painted;

float cover(float metres, float footprint) {
    float aside = abs(metres - round(metres));
    float faint = min(1.0, 2.0 * half_width / footprint) * clamp(1.5 - 3.0 * footprint, 0.0, 1.0);
    return clamp(0.5 + (half_width - aside) / footprint, 0.0, 1.0) * faint;
}

void main() {
    // The first row is the top one.
    vec3 way = ((gl_FragCoord.x - middle.x) * right + (middle.y - gl_FragCoord.y) * above) / focal - back;
    bool falls = way.y < -1e-6 && eye.y > floor_m;
    float down = falls ? way.y : -1.0;
    float far = falls ? (floor_m - eye.y) / down : 0.0;
    float reach = far * length(way) / half_faded;
    vec2 size = 2.0 * middle;
    float side = min(gl_FragCoord.x, size.x - gl_FragCoord.x);
    vec3 within = clamp(vec3(side, gl_FragCoord.y, size.y - gl_FragCoord.y) / edges, 0.0, 1.0);
    within *= within * (3.0 - 2.0 * within);
    float seen = falls ? exp2(-reach * reach) * within.x * within.y * within.z : 0.0;
    vec2 place = eye.xz + far * way.xz + shift;
    vec2 footprint = abs(far * (right.xz - way.xz * right.y / down)) + abs(far * (above.xz - way.xz * above.y / down));
    footprint = max(footprint / focal, 1e-6);
    float grid = max(cover(place.x, footprint.x), cover(place.y, footprint.y));
    float shade = 1.0 - seen * (1.0 - shades.x * (1.0 - grid * (1.0 - shades.y)));
    float grey = (ground.x * 255.0 - 16.0) * shade / 219.0;
    vec2 chroma = (ground.yz * 255.0 - 128.0) / 224.0;
    vec3 rgb = vec3(grey + 1.5748 * chroma.y, grey - 0.187324 * chroma.x - 0.468124 * chroma.y, grey + 1.8556 * chroma.x);
    painted = vec4(clamp(rgb, 0.0, 1.0), 1.0);
}
