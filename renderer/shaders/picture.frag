// A picture whose first row is the top one.
uniform sampler2D picture;

in vec2 place;
out vec4 painted;

void main() {
    painted = texture(picture, vec2(place.x, 1.0 - place.y));
}
