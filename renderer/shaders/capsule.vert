// A rectangle around one capsule: four corners, numbered by gl_VertexID.
in vec4 line;    // start x, y; way to the end x, y
in vec4 body;    // radius at the start, its growth, 1 / length squared, 1 / (2 mean radius)
in vec4 colour;  // luma or red, ...; opacity
in vec4 extra;   // shift x, y; shading; stretch of y
#ifndef CHROMA
in vec4 part_line;  // what it is lit along, as line and body
in vec4 part_body;
#endif

flat out vec4 f_line;
flat out vec4 f_body;
flat out vec4 f_colour;
flat out vec4 f_extra;
#ifndef CHROMA
flat out vec4 f_part_line;
flat out vec4 f_part_body;
#endif

uniform vec2 scale;  // pixels to clip space
uniform vec2 origin;

void main() {
    vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
    float radius = max(body.x, body.x + body.y) + EDGE;
    // What is flattened onto the floor (stretch above 1) is soft, and fades out at sqrt(2) times its radius.
    if (extra.w > 1.0) {
        radius *= 1.5;
    }
    float length2 = dot(line.zw, line.zw);
    vec2 along = length2 > 1e-3 ? line.zw * inversesqrt(length2) : vec2(1.0, 0.0);
    vec2 base = corner.x < 0.0 ? line.xy : line.xy + line.zw;
    vec2 pixel = base + (along * corner.x + vec2(-along.y, along.x) * corner.y) * radius;
    pixel.y = line.y + (pixel.y - line.y) / extra.w;
    gl_Position = vec4((pixel + extra.xy) * scale + origin, 0.0, 1.0);
    f_line = line;
    f_body = body;
    f_colour = colour;
    f_extra = extra;
#ifndef CHROMA
    f_part_line = part_line;
    f_part_body = part_body;
#endif
}
