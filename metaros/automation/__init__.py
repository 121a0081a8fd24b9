"""Code that answers what happens: functions in AWS Lambda's shape, rules and schedules, and both of them on a robot."""
