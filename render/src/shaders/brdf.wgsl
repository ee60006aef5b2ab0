// Reflection of light that comes from one direction.

// Reflected radiance per irradiance of light along `towards` (cosine included); glTF 2.0 appendix B.
fn metallic_roughness_brdf(s: Surface, towards: vec3<f32>) -> vec3<f32> {
    let n_l = saturate(dot(s.normal, towards));
    let n_v = max(abs(dot(s.normal, s.towards_eye)), 1e-4);
    let halfway = normalize(towards + s.towards_eye + vec3<f32>(1e-8, 0.0, 0.0));
    let n_h = saturate(dot(s.normal, halfway));
    let v_h = saturate(dot(s.towards_eye, halfway));
    let base_color = s.base_color.rgb;
    let roughness = saturate(s.roughness);
    let alpha = max(roughness * roughness, 0.002);
    let a2 = alpha * alpha;
    let d = n_h * n_h * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * d * d);
    let visibility = 0.5 / (n_l * sqrt(n_v * n_v * (1.0 - a2) + a2) + n_v * sqrt(n_l * n_l * (1.0 - a2) + a2) + 1e-7);
    let away = 1.0 - v_h;
    let grazing = away * away * (away * away) * away;
    let f_dielectric = mix(0.04, 1.0, grazing);
    let f_metal = mix(base_color, vec3<f32>(1.0), grazing);
    let specular = distribution * visibility;
    let dielectric = mix(base_color / PI, vec3<f32>(specular), f_dielectric);
    return mix(dielectric, f_metal * specular, saturate(s.metallic)) * n_l;
}

// The same for Blinn-Phong, so that light of intensity pi gives the sums of X3D's lighting equations.
fn phong_brdf(s: Surface, towards: vec3<f32>) -> vec3<f32> {
    let n_l = saturate(dot(s.normal, towards));
    if n_l == 0.0 {
        return vec3<f32>(0.0);
    }
    let halfway = normalize(towards + s.towards_eye + vec3<f32>(1e-8, 0.0, 0.0));
    let highlight = pow(max(dot(s.normal, halfway), 0.0), material.exponent);
    return (s.base_color.rgb * n_l + material.specular * highlight) / PI;
}

const PI: f32 = 3.14159265358979;
