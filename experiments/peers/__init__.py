"""Other denoisers, each as a call from a frame to denoised, demodulated light."""
