// The floor as `floor.Floor.rgb` computes it, from what does not change while a camera travels: only lines are moved.
uniform sampler2D lines;  // metres along x and z that each pixel sees, and pixels per metre across the lines of each
uniform sampler2D seen;   // how much of the floor has not faded
uniform vec2 shift;       // how far the camera has come, metres
uniform vec3 ground;      // luma and chromas of the background, 0..1 of the 8-bit range
uniform float half_width; // of a line, metres
uniform vec2 shades;      // of the floor and of the grid on it

out vec4 painted;

float cover(float metres, float slope) {
    float aside = abs(metres - round(metres));
    float faint = min(1.0, 2.0 * half_width * slope) * clamp(1.5 - 3.0 / slope, 0.0, 1.0);
    return clamp(0.5 + (half_width - aside) * slope, 0.0, 1.0) * faint;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 line = texelFetch(lines, pixel, 0);
    float grid = max(cover(line.x + shift.x, line.z), cover(line.y + shift.y, line.w));
    float shade = 1.0 - texelFetch(seen, pixel, 0).r * (1.0 - shades.x * (1.0 - grid * (1.0 - shades.y)));
    float grey = (ground.x * 255.0 - 16.0) * shade / 219.0;
    vec2 chroma = (ground.yz * 255.0 - 128.0) / 224.0;
    vec3 rgb = vec3(grey + 1.5748 * chroma.y, grey - 0.187324 * chroma.x - 0.468124 * chroma.y, grey + 1.8556 * chroma.x);
    painted = vec4(clamp(rgb, 0.0, 1.0), 1.0);
}
