// Shows the transparent objects over props. Elsewhere, they were drawn before.

#import bevy_plenoctree::color::{decode, encode}
#import bevy_plenoctree::front::front_at
#import bevy_plenoctree::space::light_of
#import bevy_plenoctree::target::{from_target, to_target}
#import bevy_plenoctree::view::{is_drawn, view}

// The objects over the light of props alone, in the target's color space. It has the size of the target.
@group(2) @binding(0) var objects: texture_2d<f32>;

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<u32>(position.xy);
    let pixel = at - view.corner;
    let front = front_at(pixel);
    if !is_drawn(pixel) || front.share == 0.0 {
        discard;
    }
    let found = textureLoad(objects, at, 0);
    if front.share == 1.0 && all(front.own == front.shown) {
        return found;
    }
    // What is behind the props has its objects already.
    let change = light_of(found.rgb) - decode(front.own);
    let linear = encode(max(decode(front.shown) + front.share * change, vec3(0.0)));
    let encoded = front.shown + front.share * (from_target(found.rgb) - front.own);
    return vec4(to_target(select(encoded, linear, front.is_linear)), found.a);
}
