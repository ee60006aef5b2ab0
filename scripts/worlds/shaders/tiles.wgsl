// Tiles that lie still in the world, and shadows that take a colour instead of turning black.

fn surface(s: Surface) -> Surface {
    let place = place_in_world(s.position).xz / params.size;
    let is_dark = (i32(floor(place.x)) + i32(floor(place.y))) % 2 != 0;
    var tile = s;
    tile.base_color *= select(1.0, 0.72, is_dark);
    return tile;
}

fn shade(s: Surface, light: LightSample) -> vec3<f32> {
    var open = light;
    open.shadow = 1.0;
    let lit = standard_shade(s, open);
    return mix(lit * params.tint, lit, light.shadow);
}
