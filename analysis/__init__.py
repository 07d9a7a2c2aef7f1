"""What is computed about a run or a scene: findings, stability, maps, sweeps, tuning."""
