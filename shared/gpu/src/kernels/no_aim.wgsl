// In place of `aim.wgsl` where all photons start as their lights emit them.

fn is_aimed(light: u32) -> bool { return false; }

fn mixture_start(number: u32, light: Light, plain: Emission, u: EmissionUniforms, choice: f32) -> Emission {
    return plain;
}
