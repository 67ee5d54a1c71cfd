"""Resources that passes read and write on the GPU: scene and pack buffers, layout, network, latents, culling."""
