"""Extended Kalman filter of the pose from wheel encoders, a gyro and pose fixes."""
