// Rays at a sphere of triangles, from Rust through the C interface. Each distance is compared with
// that to a perfect sphere.
use std::ffi::CStr;
use std::os::raw::{c_char, c_int}; // in std::ffi since Rust 1.64
use std::ptr;

#[repr(C)]
struct Scene {
    _private: [u8; 0],
}

#[repr(C)]
#[derive(Clone, Copy)]
struct Ray {
    origin: [f32; 3],
    tmin: f32,
    direction: [f32; 3],
    tmax: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Default)]
struct Hit {
    t: f32,
    prim: u32,
    u: f32,
    v: f32,
    geometry: u32,
    instance: u32,
}

#[link(name = "raydix_c")]
extern "C" {
    fn raydix_last_error() -> *const c_char;
    fn raydix_scene_create(scene: *mut *mut Scene) -> c_int;
    fn raydix_scene_destroy(scene: *mut Scene);
    fn raydix_scene_add_mesh(
        scene: *mut Scene,
        vertices: *const f32,
        vertex_count: usize,
        triangles: *const u32,
        triangle_count: usize,
        mask: u32,
        id: *mut u32,
    ) -> c_int;
    fn raydix_scene_commit(scene: *mut Scene, options: *const u8) -> c_int;
    fn raydix_trace_closest(
        scene: *const Scene,
        rays: *const Ray,
        count: usize,
        hits: *mut Hit,
        options: *const u8,
    ) -> c_int;
}

/// The message of a call that failed.
fn checked(status: c_int) -> Result<(), String> {
    if status == 0 {
        return Ok(());
    }
    let message = unsafe { CStr::from_ptr(raydix_last_error()) };
    Err(message.to_string_lossy().into_owned())
}

/// A committed scene of one mesh, which ends with its owner.
struct MeshScene(*mut Scene);

impl MeshScene {
    fn new(vertices: &[[f32; 3]], triangles: &[[u32; 3]]) -> Result<Self, String> {
        let mut scene = ptr::null_mut();
        unsafe {
            checked(raydix_scene_create(&mut scene))?;
            let made = MeshScene(scene);
            checked(raydix_scene_add_mesh(
                scene,
                vertices.as_ptr().cast(),
                vertices.len(),
                triangles.as_ptr().cast(),
                triangles.len(),
                u32::MAX,
                ptr::null_mut(),
            ))?;
            checked(raydix_scene_commit(scene, ptr::null()))?;
            Ok(made)
        }
    }

    fn trace(&self, rays: &[Ray]) -> Result<Vec<Hit>, String> {
        let mut hits = vec![Hit::default(); rays.len()];
        unsafe {
            checked(raydix_trace_closest(
                self.0,
                rays.as_ptr(),
                rays.len(),
                hits.as_mut_ptr(),
                ptr::null(),
            ))?;
        }
        Ok(hits)
    }
}

impl Drop for MeshScene {
    fn drop(&mut self) {
        unsafe { raydix_scene_destroy(self.0) }
    }
}

/// A sphere of radius 1: rings of corners from pole to pole.
fn sphere(rings: u32, sides: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..=rings {
        let polar = std::f32::consts::PI * ring as f32 / rings as f32;
        for side in 0..sides {
            let around = 2.0 * std::f32::consts::PI * side as f32 / sides as f32;
            let (sin, cos) = polar.sin_cos();
            vertices.push([sin * around.cos(), sin * around.sin(), cos]);
        }
    }
    for ring in 0..rings {
        for side in 0..sides {
            let (a, b) = (ring * sides + side, ring * sides + (side + 1) % sides);
            triangles.push([a, a + sides, b]);
            triangles.push([b, a + sides, b + sides]);
        }
    }
    (vertices, triangles)
}

fn main() -> Result<(), String> {
    let (vertices, triangles) = sphere(100, 200);
    let scene = MeshScene::new(&vertices, &triangles)?;
    let size = 64;
    let mut rays = Vec::new();
    for i in 0..size * size {
        let place = |n: i32| 2.5 * ((n as f32 + 0.5) / size as f32 - 0.5);
        let (x, y) = (place(i % size), place(i / size));
        let (origin, direction) = ([x, y, 3.0], [0.0, 0.0, -1.0]);
        rays.push(Ray { origin, tmin: 0.0, direction, tmax: f32::INFINITY });
    }
    let hits = scene.trace(&rays)?;
    let mut found = 0;
    for (ray, hit) in rays.iter().zip(&hits) {
        let from_axis = ray.origin[0].powi(2) + ray.origin[1].powi(2);
        if from_axis < 0.9 {
            let expected = 3.0 - (1.0 - from_axis).sqrt();
            if (hit.t - expected).abs() > 0.01 || hit.geometry != 0 || hit.instance != 0 {
                return Err(format!("t is {}, expected about {}", hit.t, expected));
            }
        } else if from_axis > 1.0 && hit.t.is_finite() {
            return Err(format!("a ray beside the sphere hits triangle {}", hit.prim));
        }
        found += u32::from(hit.t.is_finite());
    }
    let beyond = [[0, 1, vertices.len() as u32]];
    let message = MeshScene::new(&vertices, &beyond).err().ok_or("a lying index was taken")?;
    println!("{found} of {} rays hit; a lying index: {message}", rays.len());
    Ok(())
}
